# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual as pages for a browser, from docs: what the extension's zip has of it.

Markdown as the project writes it, no more: headings, paragraphs, lists, tables, code, quotes,
pictures, links, bold, italics.
"""

import html
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

PAGES = ("guide", "device", "scripting", "batch", "glossary")
"""Of docs; links to others lead to the site of the sources, or are left as words."""

_STYLE = """
body { max-width: 46rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.55 system-ui, sans-serif;
       color: #222; background: #fff }
img { max-width: 100%; height: auto }
table { border-collapse: collapse } td, th { border: 1px solid #ccc; padding: .3rem .6rem;
       text-align: left; vertical-align: top }
pre { background: #f4f4f4; padding: .8rem; overflow-x: auto } code { font-size: 90% }
h1, h2, h3, h4 { line-height: 1.2; scroll-margin-top: 1rem } a { color: #0a5bb5 }
@media (prefers-color-scheme: dark) { body { color: #ddd; background: #1d1d1d }
  pre { background: #2a2a2a } td, th { border-color: #555 } a { color: #7db4f0 } }
"""
_ITEM = re.compile(r"(\s*)(?:([-*])|(\d+)\.)\s+(.*)")


def anchor(heading: str) -> str:
    """What a heading is linked by, as code hosts have it."""
    plain = re.sub(r"[`*]|\[([^\]]*)\]\([^)]*\)", r"\1", heading)
    return re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-")


def inline(text: str) -> str:
    """A line's own marks."""
    codes: list[str] = []

    def keep(match: re.Match[str]) -> str:
        codes.append(f"<code>{html.escape(match[1], quote=False)}</code>")
        return f"\0{len(codes) - 1}\0"

    text = html.escape(re.sub(r"`([^`]+)`", keep, text), quote=False)
    text = re.sub(r"!\[([^\]]*)\]\(([^)\s]+)\)", r'<img alt="\1" src="\2">', text)
    text = re.sub(r"\[([^\]]*)\]\(([^)\s]+)\)", _link, text)
    text = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", text)
    text = re.sub(r"(?<![*\w])\*([^*]+)\*(?![*\w])", r"<em>\1</em>", text)
    return re.sub("\0(\\d+)\0", lambda match: codes[int(match[1])], text)


def _link(match: re.Match[str]) -> str:
    words, where = match[1], match[2]
    page, _, place = where.partition("#")
    if page.endswith(".md"):
        if page.removesuffix(".md") not in PAGES:
            return words
        where = page.removesuffix(".md") + ".html" + (f"#{place}" if place else "")
    elif not where.startswith(("#", "http")):
        return words
    return f'<a href="{where}">{words}</a>'


def blocks(lines: list[str]) -> Iterator[str]:
    """The page's parts."""
    at = 0
    while at < len(lines):
        line = lines[at]
        if not line.strip() or line.startswith("<!--"):
            at += 1
        elif line.startswith("```"):
            end = next(n for n in range(at + 1, len(lines)) if lines[n].startswith("```"))
            yield f"<pre><code>{html.escape(chr(10).join(lines[at + 1 : end]))}</code></pre>"
            at = end + 1
        elif match := re.fullmatch(r"(#+)\s+(.*)", line):
            size = len(match[1])
            yield f'<h{size} id="{anchor(match[2])}">{inline(match[2])}</h{size}>'
            at += 1
        else:
            end = at
            while end < len(lines) and lines[end].strip() and not lines[end].startswith("```"):
                end += 1
            part, at = lines[at:end], end
            yield from _block(part)


def _block(lines: list[str]) -> Iterator[str]:
    if lines[0].startswith("|"):
        yield _table(lines)
    elif _ITEM.match(lines[0]):
        yield _list(lines)
    elif lines[0].startswith(">"):
        yield f"<blockquote>{inline(' '.join(each.lstrip('> ') for each in lines))}</blockquote>"
    else:
        first = next((n for n, each in enumerate(lines) if _ITEM.match(each)), len(lines))
        yield f"<p>{inline(' '.join(lines[:first]))}</p>"
        if first < len(lines):
            yield _list(lines[first:])


def _table(lines: list[str]) -> str:
    rows = [[inline(cell.strip()) for cell in _cells(each)] for each in lines]
    kinds = ["th"] + ["td"] * len(rows)
    kept = [row for number, row in enumerate(rows) if number != 1]
    body = "".join(
        "<tr>" + "".join(f"<{kind}>{cell}</{kind}>" for cell in row) + "</tr>"
        for kind, row in zip(kinds, kept, strict=False)
    )
    return f"<table>{body}</table>"


def _cells(line: str) -> list[str]:
    return [each.replace("\\|", "|") for each in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def _list(lines: list[str]) -> str:
    items: list[tuple[int, str, list[str]]] = []
    for line in lines:
        match = _ITEM.match(line)
        if match is not None:
            items.append((len(match[1]), "ol" if match[3] else "ul", [match[4]]))
        elif items:
            items[-1][2].append(line.strip())
    found, open_lists = "", []
    for indent, kind, words in items:
        while open_lists and open_lists[-1][0] > indent:
            found += f"</{open_lists.pop()[1]}>"
        if not open_lists or open_lists[-1][0] < indent:
            open_lists.append((indent, kind))
            found += f"<{kind}>"
        found += f"<li>{inline(' '.join(words))}</li>"
    return found + "".join(f"</{kind}>" for _, kind in reversed(open_lists))


def page(text: str) -> str:
    """A page for a browser of a page in Markdown."""
    lines = text.splitlines()
    title = next(line for line in lines if line.startswith("# ")).lstrip("# ")
    links = " · ".join(f'<a href="{name}.html">{name.title()}</a>' for name in PAGES)
    body = "\n".join(blocks(lines))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head><body><nav>{links}</nav>\n{body}\n</body></html>\n"
    )


def write(docs: Path, folder: Path) -> None:
    """Write all pages, and the pictures that they show."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in PAGES:
        made = page((docs / f"{name}.md").read_text(encoding="utf-8"))
        (folder / f"{name}.html").write_text(made, encoding="utf-8")
        for picture in re.findall(r'<img [^>]*src="([^"]+)"', made):
            target = folder / picture
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(docs / picture, target)


if __name__ == "__main__":
    write(Path(__file__).resolve().parent.parent / "docs", Path(sys.argv[1]))

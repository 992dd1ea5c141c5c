# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts for people that know what was filled into them, so that they can be said in another
language.

A phrase is its finished English text, a ``str`` as any other. Besides, it carries the sentence
with its placeholders, which a catalogue of translations is asked for, and what was filled in. A
text without anything filled in needs nothing of this: it is looked up as it is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from string import Formatter
from typing import Any, Final, Self

Translate = Callable[[str], str]
"""From an English sentence, with placeholders or without, to the same in another language; what it
does not know it hands back."""


class Phrase(str):
    """A finished English text, with the sentence and the values that it was made of.

    It can be pickled, and is written to JSON as the text. What cuts or joins it as a ``str`` hands
    back the text alone: see :func:`joined_phrases`, :meth:`open_ended` and :meth:`capitalised`.
    """

    __slots__ = ("template", "values")
    template: str
    values: dict[str, Any]

    def __new__(cls, template: str, values: dict[str, Any]) -> Self:
        made = super().__new__(cls, cls.shaped(template.format(**values) if values else template))
        made.template = template
        made.values = values
        return made

    def __reduce__(self) -> tuple[type[Self], tuple[str, dict[str, Any]]]:
        return type(self), (self.template, self.values)

    @staticmethod
    def shaped(text: str) -> str:
        """The text as it is said where the phrase stands."""
        return text

    def told(self, translate: Translate) -> str:
        """The text in another language, and all phrases in it as well."""
        template = translate(self.template)
        if self.values:
            values = {name: _told(value, translate) for name, value in self.values.items()}
            template = template.format(**values)
        return self.shaped(template)

    def open_ended(self) -> str:
        """Without its full stop, as a part of something longer."""
        return _OpenEnded(self.template, self.values)

    def capitalised(self) -> str:
        """With a capital letter, as the beginning of a sentence."""
        return _Capitalised(self.template, self.values)


class _OpenEnded(Phrase):
    __slots__ = ()

    @staticmethod
    def shaped(text: str) -> str:
        return text.rstrip(".。")


class _Capitalised(Phrase):
    __slots__ = ()

    @staticmethod
    def shaped(text: str) -> str:
        return text[:1].upper() + text[1:]


def phrase(template: str, /, **values: Any) -> Phrase:
    """A sentence or a part of one, with placeholders as of ``str.format``, and what is filled in.

    Names of an artist's things are filled in as they are. What is itself a phrase, or an error
    that an artist can put right, is translated along with it. Without values it is a mark: a text
    that is filled into something, and looked up there.
    """
    return Phrase(template, {name: _plain(value) for name, value in values.items()})


def joined_phrases(separator: str, parts: Iterable[str]) -> Phrase:
    """Texts one after the other, as of ``separator.join``; none is made of empty ones."""
    some = {f"part_{n}": as_phrase(part) for n, part in enumerate(filter(None, parts))}
    return Phrase(separator.join(f"{{{name}}}" for name in some), some)


def as_phrase(text: str | Exception) -> Phrase:
    """A text that is to be looked up wherever it is filled in; of an error what it says."""
    plain = _plain(text)
    return plain if isinstance(plain, Phrase) else Phrase(plain, {})


def told(text: object, translate: Translate) -> str:
    """A phrase, another text or an error in another language.

    Texts that are no phrases are looked up as they are.
    """
    plain = _plain(text)
    return plain.told(translate) if isinstance(plain, Phrase) else translate(str(plain))


def packed(text: str) -> str:
    """A text as JSON, for another process; of a phrase what it is made of."""
    return json.dumps(_parts(text), ensure_ascii=False)


def unpacked(text: str) -> str:
    """What :func:`packed` has packed.

    Raises:
        ValueError: it is something else, or would fill in more than numbers and texts.
    """
    made = _of_parts(json.loads(text))
    if not isinstance(made, str):
        raise ValueError("a number")  # noqa: TRY004 - of the bytes that came, not of a caller
    return made


_PLACEHOLDER: Final = re.compile(r"\{\w*(?:![rs])?(?::,?\d?(?:\.\d)?[a-zA-Z%]?)?\}")
_BRACES: Final = re.compile(r"\{\{|\}\}")


def _parts(value: Any) -> Any:
    if isinstance(value, Phrase):
        values = {name: _parts(each) for name, each in value.values.items()}
        return [value.template, values]
    return value if isinstance(value, int | float) else str(value)


def _of_parts(value: Any) -> Any:
    match value:
        case str() | int() | float():
            return value
        case [str(template), dict(values)] if _is_template(template, values):
            return Phrase(template, {name: _of_parts(each) for name, each in values.items()})
        case _:
            raise ValueError("no text")


def _is_template(template: str, values: dict[str, Any]) -> bool:
    """Whether nothing but plain placeholders of these values stands in it."""
    if not values:
        return True
    rest = _PLACEHOLDER.sub("", _BRACES.sub("", template))
    named = {name for _, name, _, _ in Formatter().parse(template) if name is not None}
    return not set("{}") & set(rest) and named <= values.keys()


def _plain(value: Any) -> Any:
    """What is kept of a value: nothing that holds on to more than it says."""
    if not isinstance(value, Exception):
        return value
    problem, remedy = getattr(value, "problem", None), getattr(value, "remedy", "")
    return joined_phrases(" ", (problem, remedy)) if problem else str(value)


def _told(value: Any, translate: Translate) -> Any:
    return value.told(translate) if isinstance(value, Phrase) else value

// SPDX-License-Identifier: GPL-3.0-or-later
// Flamenco 3: copy this file as octo_motion.js into the folder "scripts" beside the manager.

const JOB_TYPE = {
    label: "Octo Motion",
    description: "Make the shots of an Octo Motion job file, in chunks",
    settings: [
        { key: "job_file", type: "string", subtype: "file_path", required: true,
          description: "The job file (TOML), where all workers see it" },
        { key: "shots", type: "int32", required: true, propargs: { min: 1 },
          description: "How many shots it has, as bake --list counts them" },
        { key: "chunk_size", type: "int32", default: 10, propargs: { min: 1 },
          description: "Shots that one task makes, one after the other" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    if (!(settings.shots >= 1) || !(settings.chunk_size >= 1)) {
        throw "Shots and chunk size must be 1 or more.";
    }

    const check = bakeTask("check", "misc", settings, ["--list"]);
    job.addTask(check);

    const gather = bakeTask("gather", "misc", settings, ["--gather"]);
    for (let first = 1; first <= settings.shots; first += settings.chunk_size) {
        const last = Math.min(first + settings.chunk_size - 1, settings.shots);
        const places = `${first}-${last}`;
        const task = bakeTask(`bake ${places}`, "blender", settings, ["--index", places, "--here"]);
        task.addDependency(check);
        gather.addDependency(task);
        job.addTask(task);
    }
    job.addTask(gather);
}

function bakeTask(name, type, settings, words) {
    const task = author.Task(name, type);
    task.addCommand(author.Command("exec", {
        exe: "{blender}",
        args: ["--background", "--command", "octo_motion", "bake", settings.job_file].concat(words),
    }));
    return task;
}

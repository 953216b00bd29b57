"""References that are what the program says of itself: commands, keys of scenarios and summaries, models."""

import json
import os
import re
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata


@cache
def said(*arguments: str) -> str:
    """What the program prints."""
    command = [os.environ["PENDULA_PROGRAM"], *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def told(*arguments: str) -> dict | list:
    return json.loads(said(*arguments, "--json"))


def commands() -> list[str]:
    listed = re.search(r"^Commands:\n((?:  .*\n)+)", said("--help"), re.MULTILINE)[1]
    return [name for name in re.findall(r"^  (\S+)", listed, re.MULTILINE) if name != "help"]


def text(words: str, classes: Sequence[str] = ()) -> nodes.paragraph:
    """A paragraph; what stands in backquotes is code."""
    paragraph = nodes.paragraph(classes=list(classes), support_smartquotes=False)
    for k, part in enumerate(words.split("`")):
        if part:
            paragraph += nodes.literal(part, part) if k % 2 else nodes.Text(part)
    return paragraph


def code(words: str, language: str = "text") -> nodes.literal_block:
    return nodes.literal_block(words, words, language=language)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> nodes.table:
    """A table without the columns that have nothing."""
    kept = [k for k in range(len(heads)) if any(cells[k] for cells in rows)]
    heads, rows = [heads[k] for k in kept], [[cells[k] for k in kept] for cells in rows]
    made = nodes.table(classes=["keys"])
    group = nodes.tgroup(cols=len(heads))
    group += [nodes.colspec(colwidth=1) for _ in heads]
    made += group

    def row(cells: Sequence[str]) -> nodes.row:
        return nodes.row("", *[nodes.entry("", text(cell)) for cell in cells])

    group += nodes.thead("", row(heads))
    group += nodes.tbody("", *[row(cells) for cells in rows])
    return made


class Told(SphinxDirective):
    """Sections and tables from what the program says."""

    def section(self, title: str, *content: nodes.Node) -> nodes.section:
        made = nodes.section(ids=[nodes.make_id(title)], names=[nodes.fully_normalize_name(title)])
        made += nodes.title(title, "", *text(title).children)
        made += content
        self.state.document.note_implicit_target(made)
        return made


class CommandHelp(Told):
    """All commands, each with its help."""

    def run(self) -> list[nodes.Node]:
        found = []
        for name in commands():
            about, rest = said("help", name).split("\n\nUsage: ", 1)
            found.append(
                self.section(f"pendula {name}", text(" ".join(about.split())), code("Usage: " + rest))
            )
        return found


class ProgramHelp(Told):
    """What `pendula --help` prints."""

    def run(self) -> list[nodes.Node]:
        return [code(said("--help"))]


def default(key: dict) -> str:
    """A value as code, words as words."""
    otherwise = key["x-default"] or "must be given"
    return f"`{otherwise}`" if "default" in key else "" if otherwise == "none" else otherwise


def value(key: dict) -> str:
    unit = key.get("x-unit", "1")
    return key["x-type"] if unit in ("", "1") else f"{key['x-type']}, {unit}"


class ScenarioKeys(Told):
    """The keys of one table of scenarios: `chain.drive`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        name = self.arguments[0]
        schema = told("help", "scenario")
        for part in name.split("."):
            if part not in schema["properties"]:
                raise self.error(f"scenario-keys: expected a table of scenarios, got {name}")
            schema = schema["properties"][part]
            schema = schema.get("items", schema)
        rows = [
            [f"`{key}`", of["description"], value(of), default(of)]
            for key, of in schema["properties"].items()
            if "properties" not in of.get("items", of)
        ]
        return [table(["key", "what", "value", "otherwise"], rows)]


class SummaryKeys(Told):
    """The keys of the summary as JSON."""

    def run(self) -> list[nodes.Node]:
        rows = [
            [f"`{key}`", of["description"], of.get("x-unit", "")]
            for key, of in told("help", "summary")["properties"].items()
        ]
        return [table(["key", "what", "unit"], rows)]


class BuiltInModels(Told):
    """What `pendula describe` says of each model that pendula brings, and the model's file."""

    def one(self, model: dict) -> nodes.section:
        content: list[nodes.Node] = [text(model["about"][0].upper() + model["about"][1:].rstrip(".") + ".")]

        def add(heads: Sequence[str], rows: list[list[str]]) -> None:
            if rows:
                content.append(table(heads, rows))

        add(
            ["coordinate", "unit", "what"],
            [[f"`{x['name']}`", x["unit"], x["remark"]] for x in model["coordinates"]],
        )
        add(
            ["parameter", "unit", "default", "what"],
            [
                [
                    f"`{x['name']}`" + (" (one a link)" if x["per_link"] else ""),
                    x["unit"],
                    "must be given" if x["default"] is None else f"`{x['default']:g}`",
                    x["remark"],
                ]
                for x in model["parameters"]
            ],
        )
        add(["input", "unit", "what"], [[f"`{x['name']}`", x["unit"], x["remark"]] for x in model["inputs"]])
        add(["point", "columns"], [[f"`{x['name']}`", ", ".join(x["columns"])] for x in model["points"]])
        file = nodes.container(classes=["model-file"])
        file += text("Its file:")
        file += code(Path(model["file"]).read_text(), "python")
        return self.section(model["model"], *content, file)

    def run(self) -> list[nodes.Node]:
        return [self.one(told("describe", model["model"])) for model in told("models")]


def setup(app: Sphinx) -> ExtensionMetadata:
    directives.register_directive("program-help", ProgramHelp)
    directives.register_directive("command-help", CommandHelp)
    directives.register_directive("scenario-keys", ScenarioKeys)
    directives.register_directive("summary-keys", SummaryKeys)
    directives.register_directive("built-in-models", BuiltInModels)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""The built-in link models, by name."""

from pendula_codegen.errors import GenerationError
from pendula_codegen.link_model import LinkModel
from pendula_codegen.links import planar, spatial

LINKS: dict[str, LinkModel] = {module.MODEL.name: module.MODEL for module in (planar, spatial)}


def find_link(name: str) -> LinkModel:
    """The model called `name`; raises GenerationError naming those that exist."""
    if name not in LINKS:
        raise GenerationError(f"unknown model '{name}': expected one of {', '.join(LINKS)}")
    return LINKS[name]

"""The built-in link models, by name."""

from pendula_codegen.errors import GenerationError
from pendula_codegen.model import LinkModel
from pendula_codegen.models import planar, spatial

MODELS: dict[str, LinkModel] = {module.MODEL.name: module.MODEL for module in (planar, spatial)}


def find_model(name: str) -> LinkModel:
    """The model called `name`; raises GenerationError naming those that exist."""
    if name not in MODELS:
        raise GenerationError(f"unknown model '{name}': expected one of {', '.join(MODELS)}")
    return MODELS[name]

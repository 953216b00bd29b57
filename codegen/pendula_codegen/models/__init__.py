"""The built-in models: files of the same kind as a user's, found by name."""

from __future__ import annotations

from pathlib import Path

from pendula_codegen.errors import GenerationError

FOLDER = Path(__file__).parent


def model_names() -> list[str]:
    return sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")


def find_model(name: str) -> Path:
    """The model file called `name`: a path, or a built-in model. Raises GenerationError naming those that exist."""
    path = Path(name)
    if path.suffix == ".py" or path.parent != Path("."):
        return path
    if name in model_names():
        return FOLDER / f"{name}.py"
    raise GenerationError(
        f"unknown model '{name}': expected a file ending in .py, or one of {', '.join(model_names())}"
    )

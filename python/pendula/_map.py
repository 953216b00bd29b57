"""Maps of ensembles, as ``pendula map`` draws them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._core import InputError
from ._pictures import module_of_pictures
from ._runs import missing

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


def map(
    data: xarray.Dataset,
    key: str,
    *,
    axes: Axes | None = None,
    scale: str | None = None,
    contour: tuple[str, float] | None = None,
) -> Axes:
    """Draws a number of every member of an ensemble: over two axes as colours, over one as a curve.

    Parameters
    ----------
    data : xarray.Dataset
        From :func:`ensemble` or :func:`open_ensemble`, over one axis or two; the first one is horizontal.
    key : str
        The name of a data set, or its name in ``keep``: "theta_2", "final:theta_2", "event:flip".
    axes : matplotlib Axes, optional
        By default those of a new figure.
    scale : {"log", "linear"}, optional
        By default logarithmic if a positive number spans a wide range. Angles are cyclic.
    contour : (str, float), optional
        The name of another number and its value on a line.

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import numpy, pendula
    >>> grid = numpy.linspace(-1, 1, 5)
    >>> data = pendula.ensemble(pendula.Chain(masses=[1, 1]), 1.0, {"theta": (grid, grid)})
    >>> pendula.map(data, "final:theta_2").get_xlabel()
    '$θ_{1}$ [rad]'
    """
    try:
        drawing = module_of_pictures("map")
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise missing("pictures", error) from None
    if data.attrs.get("kind") != "ensemble":
        raise InputError("data: expected the dataset of an ensemble, got another one")
    if scale not in (None, "log", "linear"):
        raise InputError(f'scale: expected "log" or "linear", got {scale!r}')
    line, level = contour if contour is not None else ("", None)
    choice = drawing.MapChoice(scale or "", None if level is None else float(level))
    errors = module_of_pictures("errors")
    try:
        shown = _of(drawing, data, key, line)
        # Made before the style is set: the first figure chooses a backend, whose settings have to stay. Otherwise a
        # notebook shows no figure after this one.
        figure = plt.figure(layout="constrained") if axes is None else axes.figure
        with drawing.style(), errors.told_of_numbers("data"):
            if axes is None:
                axes = figure.add_subplot()
            if len(shown.axes) == 1:
                drawing.draw_curve(axes, shown, choice)
            else:
                drawing.draw_map(figure, axes, shown, choice)
    except errors.PlotError as error:
        raise InputError(str(error)) from None
    return axes


def _of(drawing: Any, data: xarray.Dataset, key: str, line: str) -> Any:
    """The numbers to show, in the form that pictures read from a file."""
    status = data["status"]
    if len(status.dims) > 2 or "member" in status.dims:
        raise InputError(f"data: expected one axis or two, got {', '.join(str(dim) for dim in status.dims)}")
    kept = {str(name): one for name, one in data.data_vars.items() if one.dims == status.dims}
    key, line = (drawing.called("data", kept, name) if name else "" for name in (key, line))
    scales = [data[dim] for dim in status.dims]
    axes = [(str(one.attrs["long_name"]), drawing.unit_of(one.attrs), one.values) for one in scales]
    unit = drawing.unit_of(kept[key].attrs)
    return drawing.Ensemble(
        "data",
        key,
        drawing.counted(kept[key].values),
        unit,
        status.values,
        axes,
        kept[line].values if line else None,
        bool(data.attrs["complete"]),
        drawing.duration_of(data.attrs, [name for name, _, _ in axes], unit),
    )

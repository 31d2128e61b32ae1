"""Responses as labelled arrays of xarray and tables of pandas, and back, without loss.

Both libraries are optional, and imported when they are asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from simple_model.quantities import quantity

if TYPE_CHECKING:
    from simple_model.response import Response

AXES = "xyz"


def library(name: str) -> Any:
    """An optional library.

    Raises
    ------
    ImportError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ImportError(f"{name} is not installed; pip install {name}", name=name) from None


def attributes(response: "Response") -> dict[str, Any]:
    """Quantity, unit, model, error and warnings, of types that netCDF takes."""
    return {
        "units": response.unit,
        "long_name": response.record.words,
        "quantity": response.quantity,
        "model": response.model,
        "expected_error": float(response.expected_error),
        "warnings": "\n".join(response.effort.warnings),
    }


def to_xarray(response: "Response") -> Any:
    """A response as a DataArray (time, probe)."""
    places = {
        axis: ("probe", x.copy(), {"units": "m"})
        for axis, x in zip(AXES, response.probes.T, strict=False)
    }
    return library("xarray").DataArray(
        response.values.copy(), dims=("time", "probe"), name=response.quantity,
        coords={"time": ("time", response.times.copy(), {"units": "s"}), **places},
        attrs=attributes(response),
    )  # fmt: skip


def of_xarray(array: Any) -> dict[str, Any]:
    """Fields of a response from a DataArray (time, probe).

    Raises
    ------
    ValueError
        If it has no such dimensions or coordinates, or is not in SI.
    """
    if set(array.dims) != {"time", "probe"} or not {"time", "x", "y"} <= set(array.coords):
        raise ValueError(
            f"the array has dimensions {tuple(array.dims)} and coordinates "
            f"{tuple(array.coords)}; give time and probe, with x and y of the probes"
        )
    for name, unit in (("time", "s"), ("x", "m"), ("y", "m")):
        _check_unit(name, array[name].attrs.get("units", unit), unit)
    axes = [axis for axis in AXES if axis in array.coords]
    return {
        "times": array["time"].values,
        "probes": np.column_stack([array[axis].values for axis in axes]),
        "values": array.transpose("time", "probe").values,
        **_known(array.attrs),
    }


def to_pandas(response: "Response") -> Any:
    """A response as a DataFrame: rows by time_s, columns by the x_m and y_m of the probes."""
    pd = library("pandas")
    names = [f"{axis}_m" for axis in AXES[: response.probes.shape[1]]]
    frame = pd.DataFrame(
        response.values.copy(),
        index=pd.Index(response.times.copy(), name="time_s"),
        columns=pd.MultiIndex.from_arrays(response.probes.T.copy(), names=names),
    )
    frame.attrs = attributes(response)
    return frame


def of_pandas(frame: Any) -> dict[str, Any]:
    """Fields of a response from a DataFrame as `to_pandas` makes it.

    Raises
    ------
    ValueError
        If its rows are not by time_s or its columns not by x_m and y_m.
    """
    if frame.index.name != "time_s" or list(frame.columns.names)[:2] != ["x_m", "y_m"]:
        raise ValueError(
            f"the rows of the table are by {frame.index.name} and its columns by "
            f"{', '.join(map(str, frame.columns.names))}; give time_s, and x_m and y_m"
        )
    return {
        "times": frame.index.to_numpy(),
        "probes": np.array(frame.columns.to_list()),
        "values": frame.to_numpy(),
        **_known(frame.attrs),
    }


def _known(attributes: Any) -> dict[str, Any]:
    missing = [name for name in ("quantity", "model") if name not in attributes]
    if missing:
        raise ValueError(f"the attributes lack {' and '.join(missing)}; add them")
    _check_unit("values", attributes.get("units"), quantity(attributes["quantity"]).unit)
    return {name: attributes[name] for name in ("quantity", "model")} | {
        "expected_error": attributes.get("expected_error", np.nan),
        "warnings": tuple(filter(None, attributes.get("warnings", "").split("\n"))),
    }


def _check_unit(name: str, found: object, expected: str) -> None:
    if found != expected:
        raise ValueError(f"{name} are in {found}, not {expected}; convert them")

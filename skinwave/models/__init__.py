"""Models: a `Model` for each, which its file registers; loaded when it is first asked for.

Importing this room loads no numerical library, because the command line lists the names.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from math import nan
from typing import TYPE_CHECKING

from skinwave.system import extensions

if TYPE_CHECKING:
    from simple_model import Response
    from skinwave.bodies import Body
    from skinwave.models.options import SolveOptions
    from skinwave.scene.scene import Scene
    from skinwave.typing import Floats

BUILT_IN = {  # name -> the file that registers it
    "point-kernel": "point_kernel",
    "point-kernel-published": "point_kernel",
    "flat-body": "flat_body",
    "flat-body-harmonic": "flat_body",
    "fem": "linear_elements",
    "fem-harmonic": "linear_elements",
    "fem-transient": "linear_elements",
    "fem-nonlinear": "stretching",
    "fem-nonlinear-transient": "stretching",
    "plate-modes": "plate_modes",
    "plate-modes-transient": "plate_modes",
    "plate-modes-nonlinear": "plate_modes",
}


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Limit of a model that a scene is beyond.

    Parameters
    ----------
    why : str, what the model takes, and not what the scene has: "takes a flat sheet, not a curled
        one"
    cure : str, how to change the scene, in the imperative; "" if no change of it would help
    change : the scene -> the scene so changed
    """

    why: str
    cure: str = ""
    change: "Callable[[Scene], Scene] | None" = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Model: how it computes a scene's response, and what is known of that.

    Parameters
    ----------
    name, label : str, in commands and tables; in legends
    method : str, in a plan: what is computed, in a few words
    words : str, on pages: what it computes and leaves out, one clause
    solve : response of a scene at times (t,) in s, equally spaced from 0, with some options
    limits : of a scene with a body, each `Limit` of the model that it is beyond; if not given, it
        takes the displacement of the surface under a pressure alone
    error : expected relative error with elements of a size in metre, nan if it is unknown; None for
        linear waves, whose error a plan estimates by reflections and transient, or mesh refinement
    default_size : element size in metre for a body; None without a mesh
    seconds, memory : predicted for a first response where a plan does not measure, s and bytes
    colour : str, of figures
    sources : of str, references to cite for its method
    quantity : name of the one that it has whatever a scene asks for, as the point kernel has; or ""
    needs_body : bool
    is_reduced : bool, whether bodies are reduced once for all Tactons
    is_infinite : bool, whether it leaves out reflections from the sides
    from_rest : name of the model that adds the start to it, of a model of the steady state; or ""
    is_stepped : bool, whether its error depends on a time step
    is_nonlinear : bool, whether it has large deflections
    takes_series : whether it takes Prony series for modulus laws of a body
    """

    name: str
    method: str
    words: str
    solve: "Callable[[Scene, Floats, SolveOptions], Response]"
    limits: "Callable[[Scene], Iterable[Limit]] | None" = None
    error: "Callable[[Scene, float | None], float] | None" = lambda scene, h: nan
    default_size: "Callable[[Body], float] | None" = None
    seconds: float = 0.1
    memory: float = 1e8
    colour: str = "#56B4E9"
    sources: tuple[str, ...] = ()
    label: str = ""
    quantity: str = ""
    needs_body: bool = True
    is_reduced: bool = False
    is_infinite: bool = False
    from_rest: str = ""
    is_stepped: bool = False
    is_nonlinear: bool = False
    takes_series: "Callable[[Body], bool]" = lambda body: False

    @property
    def is_steady(self) -> bool:
        """Whether it is of the steady state, and leaves out the start from rest."""
        return bool(self.from_rest)


_MODELS: dict[str, Model] = {}


def register(model: Model) -> Model:
    """Add a model to those that scenes can be computed by.

    Raises
    ------
    ValueError
        If there is one of that name.
    """
    home = BUILT_IN.get(model.name)
    if home and not model.solve.__module__.startswith(f"{__name__}."):
        raise ValueError(f"'{model.name}' is registered already; choose another name")
    extensions.add(_MODELS, model.name, model, model.solve)
    return model


def names() -> tuple[str, ...]:
    """All models by name, the built-in ones first."""
    return (*BUILT_IN, *(name for name in _MODELS if name not in BUILT_IN))


def named(name: str) -> Model:
    """The model of a name.

    Raises
    ------
    ValueError
        If there is none.
    """
    from simple_model.choices import choose

    if name in BUILT_IN:
        import_module(f"{__name__}.{BUILT_IN[name]}")
    elif name not in _MODELS:
        extensions.load()
    return _MODELS[choose("model", name, names())]

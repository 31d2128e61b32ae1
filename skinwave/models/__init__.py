"""Models: each file registers its `Model`, and is imported when the model is first used.

Importing this package loads no numerical library, because the command line lists the names.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from skinwave.system import extensions
from skinwave.system.extensions import Registry

if TYPE_CHECKING:
    from simple_model import Effort, ErrorPart, Response
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
    """Limit of a model that a scene exceeds.

    Parameters
    ----------
    why : str, continues the model's name: "needs a flat sheet, not a curled one"
    cure : str, change of the scene in the imperative; "" if no change helps
    change : function of the scene that returns the changed scene
    """

    why: str
    cure: str = ""
    change: "Callable[[Scene], Scene] | None" = None


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Predicted cost of the first response to a scene.

    Parameters
    ----------
    parts : mapping from a change that makes a part cheaper, in the imperative, to the seconds of
        that part on one core of the machine on which the factors of its formula were measured
    memory : float, largest memory of the process in bytes
    long : float, s, above which the largest part's change is worth stating
    """

    parts: "Mapping[str, float]"
    memory: float
    long: float = 30.0

    @property
    def seconds(self) -> float:
        """Seconds of all parts."""
        return sum(self.parts.values())

    @property
    def cure(self) -> str:
        """The change that makes the largest part cheaper; "" if the response is not long."""
        return max(self.parts, key=self.parts.__getitem__) if self.seconds > self.long else ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Model: how it computes the response of a scene, and its properties.

    Parameters
    ----------
    name, label : str, for commands and tables, and for legends
    method : str, a few words for plans
    words : str, a clause for pages: what it computes and leaves out
    solve : function of a scene, times (t,) in s equally spaced from 0, and options; returns the
        response
    limits : function of a scene with a body that yields each `Limit` that it exceeds; by default
        the model computes only the displacement of the surface under a pressure
    parts : function of scene and options, with the element size, that yields each `ErrorPart` of
        the model itself; a plan adds what the model leaves out of the scene. By default nothing is
        known
    default_size : function of a body that returns its element size in m; None without a mesh
    cost : function of scene, options with the element size, and the effort of the body that a plan
        reduced, empty without one, that returns the predicted `Cost`; None if it is unknown
    colour : str, for figures
    sources : tuple of str, references of its method
    quantity : str, name of a quantity that it always computes, such as pressure; or ""
    needs_body : bool
    is_reduced : bool, whether bodies are reduced once for all Tactons
    is_infinite : bool, whether it leaves out reflections from the sides
    from_rest : str, name of the model from rest, for a model of the steady state; or ""
    is_stepped : bool, whether its error depends on a time step
    is_nonlinear : bool, whether it includes large deflections
    takes_series : function of a body: whether Prony series replace its modulus laws
    """

    name: str
    method: str
    words: str
    solve: "Callable[[Scene, Floats, SolveOptions], Response]"
    limits: "Callable[[Scene], Iterable[Limit]] | None" = None
    parts: "Callable[[Scene, SolveOptions], Iterable[ErrorPart]] | None" = None
    default_size: "Callable[[Body], float] | None" = None
    cost: "Callable[[Scene, SolveOptions, Effort], Cost] | None" = None
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
    def is_refined(self) -> bool:
        """Whether a plan refines its mesh, and estimates its error from two meshes."""
        return self.default_size is not None and not self.is_nonlinear

    @property
    def is_steady(self) -> bool:
        """Whether it computes the steady state and leaves out the start from rest."""
        return bool(self.from_rest)


MODELS = Registry[Model](
    what="model", built_in={name: f"{__name__}.{file}" for name, file in BUILT_IN.items()}
)


def register(model: Model) -> Model:
    """Register a model under its name; raises a ValueError if the name is taken."""
    from skinwave.models.options import underflow_to_zero

    model = replace(model, solve=underflow_to_zero()(model.solve))
    extensions.add(MODELS, model.name, model, model.solve)
    return model


def names() -> tuple[str, ...]:
    """Return the names of all models, the built-in ones first."""
    return extensions.names(MODELS)


def named(name: str) -> Model:
    """Return the model with a name; raises a ValueError if the name is unknown."""
    return extensions.find(MODELS, name)

"""References to cite for a response: the program, the model and the solver."""

from dataclasses import dataclass

from simple_model import Response, drawing
from skinwave.models import named
from skinwave.system.effort import versions

VERSION, RELEASED = "1.0.0", 2026  # as CITATION.cff has them
SOLVERS = {
    "pardiso": "O. Schenk, K. Gärtner: Solving unsymmetric sparse systems of linear equations with "
    "PARDISO. Future Generation Computer Systems 20 (2004) 475-487. "
    "doi 10.1016/j.future.2003.07.011",
    "superlu": "J. W. Demmel, S. C. Eisenstat, J. R. Gilbert, X. S. Li, J. W. H. Liu: A "
    "supernodal approach to sparse partial pivoting. SIAM Journal on Matrix Analysis and "
    "Applications 20 (1999) 720-755. doi 10.1137/S0895479895291765",
}


@dataclass(frozen=True, kw_only=True)
class Citations:
    """A sentence for a methods section, and the references to cite; prints one per line."""

    sentence: str
    references: tuple[str, ...]

    def __str__(self) -> str:
        listed = (f"[{k}] {text}" for k, text in enumerate(self.references, 1))
        return "\n".join([self.sentence, *listed])

    def _repr_html_(self) -> str:
        rows = [[f"[{k}]", text] for k, text in enumerate(self.references, 1)]
        return drawing.page(self.sentence, b"", [drawing.table(rows)])


def cite(*responses: Response) -> Citations:
    """Return the references to cite for some responses.

    Parameters
    ----------
    *responses : Response

    Returns
    -------
    Citations, with the program, the sources of each model, and the solvers used

    Raises
    ------
    ValueError
        If no response is given or a model is unknown.

    Examples
    --------
    >>> import skinwave
    >>> scene = skinwave.loads("[tacton]\\nduration_s = 0.05\\n[body]\\nkind = 'none'")
    >>> print(skinwave.cite(skinwave.simulate(scene, "point-kernel")).references[1][:38])
    C. Lim, H. Seifi, G. Park: An Interact
    """
    if not responses:
        raise ValueError("no response is given. Give one or more")
    models = list(dict.fromkeys(response.model for response in responses))
    methods = ", ".join(f"{name} ({named(name).method})" for name in models)
    release = {**versions(), **responses[0].effort.versions}.get("skinwave", "of unknown version")
    year = f", {RELEASED}" if release == VERSION else ""
    program = (
        "The skinwave authors: skinwave: waves in skin and paper under mid-air ultrasound haptics. "
        f"Version {release}{year}. Software"
    )
    sources = [source for name in models for source in named(name).sources]
    used = {response.effort.solver for response in responses}
    solvers = [text for name, text in SOLVERS.items() if any(name in each for each in used)]
    tactons = (
        "C. Lim, H. Seifi, G. Park: An Interactive Tool for Simulating Mid-Air Ultrasound Tactons "
        "on the Skin. Extended Abstracts of the CHI Conference on Human Factors in Computing "
        "Systems (CHI EA '24), 2024. doi 10.1145/3613905.3650981"
    )
    return Citations(
        sentence=f"Responses were computed with skinwave {release} by {methods}.",
        references=tuple(dict.fromkeys([program, tactons, *sources, *solvers])),
    )

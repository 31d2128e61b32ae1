"""Materials with a modulus law of their own, which only models in the frequency domain take."""

from skinwave.bodies import Body
from skinwave.models import Model


def has_own_law(body: Body) -> bool:
    """Whether a material of a body has a modulus law of its own."""
    return any(solid.law is not None for _, solid in body.strata)


def frequency_only(body: Body, model: Model) -> None:
    """Refuse a body with a modulus law of its own in models that integrate internal variables.

    Raises
    ------
    ValueError
        If the model is one of these.
    """
    if model.has_internal_variables and has_own_law(body):
        raise ValueError(
            f"{model.name} integrates internal variables, which a material with a modulus law of "
            "its own has not; give it Prony terms, or use --model fem-harmonic or "
            "flat-body-harmonic"
        )

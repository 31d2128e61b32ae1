"""Materials with a modulus law of their own, which only models in the frequency domain take."""

from skinwave.bodies import Body


def has_own_law(body: Body) -> bool:
    """Whether a material of a body has a modulus law of its own."""
    return any(solid.law is not None for _, solid in body.strata)


def without_own_law(model: str, body: Body) -> None:
    """Refuse a body with a modulus law of its own, for a model that integrates internal variables.

    Raises
    ------
    ValueError
        If it has one.
    """
    if has_own_law(body):
        raise ValueError(
            f"{model} integrates internal variables, which a material with a modulus law of "
            "its own has not; give it Prony terms, or use --model fem-harmonic or "
            "flat-body-harmonic"
        )

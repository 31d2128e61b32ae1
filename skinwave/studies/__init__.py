"""Studies: Tactons compared, accuracy against cost, assumptions dropped."""

"""Help at each control of the page, in a sentence or two."""

HELP = {
    "amplitude": "Share of full drive. Pressure follows the drive law: half of it is a quarter of "
    "the pressure if pressure goes with its square.",
    "am": "Frequency by which the focus is modulated in amplitude (temporal modulation); 0 is off.",
    "am2": "A second sinusoid, which multiplies the first one, by its superposition ratio; 0 is "
    "off.",
    "ratio": "Weights of the two sinusoids, as in the published tool.",
    "envelope": "A slow sinusoid over the whole Tacton: lines at f_AM ± f_e; 0 is off.",
    "duration": "How long the Tacton lasts. Lines closer than about its inverse cannot be told "
    "apart.",
    "pulses": "A rhythm: each pulse and the gap after it, in ms, again and again to the end.",
    "ramp": "How long a pulse takes to rise and to fall.",
    "foci": "Several foci, on one path at equal distances or with paths of their own, share the "
    "pressure.",
    "size": "Diameter of a circle, side of a square or a triangle, length of a line.",
    "speed": "Of the focus along its path (spatiotemporal modulation). Where it is near the speed "
    "of the surface waves, about 5 to 8 m/s in skin, they add up.",
    "drawn": "How often a second each path is drawn.",
    "phases": "Where on the path each focus begins.",
    "sharing": "How a device makes several foci; the load of this model is the same.",
    "height": "Of the focus above the array: further away it is wider and weaker.",
    "drive": "How pressure on the skin follows from the drive of the array: radiation pressure "
    "goes with the square of sound pressure.",
    "profile": "Pressure across the focus.",
    "x": "Where waveform, spectrum and lines are read. Click a map, or use its arrow keys.",
    "y": "Where waveform, spectrum and lines are read. Click a map, or use its arrow keys.",
    "depth": "Below the surface: Meissner corpuscles lie at about 0.7 mm, Pacinian ones at 2 mm.",
    "quantity": "What is read at the point: motion of the body, its velocity, strain or stress.",
}

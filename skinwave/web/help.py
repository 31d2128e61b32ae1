"""Help at each control of the page, in a sentence or two: by its key, that of a part of a layer or,
of the bar above the page, in `BAR` with its name.
"""

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
    "body": "What the focus pushes. A slab and its layers follow a slider, paper and palm are "
    "first reduced by finite elements; none leaves the point kernel alone.",
    "layers": "Each layer from the surface downwards. It keeps its loss factor when its modulus "
    "moves.",
    "thickness": "How thick the layer is; waves whose length is much less do not reach below it.",
    "modulus": "Shear modulus: waves are faster where it is higher, as its square root.",
    "loss": "Share of the energy that is lost in each radian at 200 Hz: waves reach less far where "
    "it is higher.",
    "shape": "Path that the focus is drawn along, again and again; a point rests.",
    "paths": "All foci follow one path at phases of it, or each has a path of its own.",
    "hold": "Size, shape and speed move together, so that the path is drawn as often a second as "
    "it is now.",
    "published": "The point kernel under the load of the paper, whatever drive law and profile are "
    "chosen: a linear drive and the main lobe.",
    "opened": "A scene file, as Save writes it or the command line takes it: it sets all controls.",
    "measured_file": "Displacement or another quantity over time or frequency, with its unit: that "
    "of the place nearest the point is drawn beside the waves.",
    "quantity": "What is read at the point: motion of the body, its velocity, strain or stress.",
}
BAR = {
    "presets": ("Presets", "The 15 Tactons of the paper; body and focus stay as they are."),
    "span": ("Part of the Tacton", "Which part of commanded signal and waveform is shown. Drawing "
             "over a plot, or plus and minus, zoom in further."),
    "third": ("Third plot", "The spectrum at the point; phase speeds of the body's waves with the "
              "lines that drive them; or the sensation level over a control, of which Set to "
              "highest takes the best value."),
    "decibel": ("dB", "The spectrum in decibel over 80 dB, or linear."),
    "highest": ("Highest frequency", "Where the axis of frequency ends."),
    "undo": ("Undo, redo", "Moves of controls, presets, examples and scenes; Ctrl+Z and Ctrl+Y."),
    "pin": ("Pin, A/B", "Keeps what is shown as A, to compare with what comes then, B; A/B "
            "exchanges them. Where they differ by more than ten times, each is drawn over its "
            "largest."),
    "save": ("Save", "Scene, waveform, sound, patterns for devices and a report; figures have the "
             "plots and maps as they are shown, 3.5 or 7 inch wide, with letters of 8 points."),
}  # fmt: skip

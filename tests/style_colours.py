"""How far two colours are apart, in normal sight and to those who are blind to red or green.

Lab by CIE 15, distances by CIE76, sight by the matrices of Machado, Oliveira and Fernandes (2009) at full severity in
linear RGB, contrast by WCAG 2.1.
"""

SIGHTS = ("normal", "deuteranope", "protanope")
LINEAR = (((1, 0, 0), (0, 1, 0), (0, 0, 1)),
          ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881)),
          ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998)))
TO_XYZ = ((0.4124564, 0.3575761, 0.1804375), (0.2126729, 0.7151522, 0.0721750), (0.0193339, 0.1191920, 0.9503041))
WHITE = (0.95047, 1.0, 1.08883)


def times(matrix, vector):
    return [sum(a * b for a, b in zip(row, vector)) for row in matrix]


def linear_rgb(colour):
    parts = [int(colour[i:i + 2], 16) / 255 for i in (1, 3, 5)]
    return [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]


def lab(rgb):
    scaled = [x / white for x, white in zip(times(TO_XYZ, [min(max(part, 0), 1) for part in rgb]), WHITE)]
    x, y, z = (t ** (1 / 3) if t > 216 / 24389 else (24389 / 27 * t + 16) / 116 for t in scaled)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def as_seen(colour):
    """Lab of '#RRGGBB' in each of SIGHTS."""
    rgb = linear_rgb(colour)
    return [lab(times(matrix, rgb)) for matrix in LINEAR]


def contrast_on_white(colour):
    return 1.05 / (times(TO_XYZ, linear_rgb(colour))[1] + 0.05)

"""Colours of the scene, the same as in plots and figures; each reads on a light and on a dark ground."""

Colour = tuple[int, int, int]

COM: Colour = (214, 36, 36)  # red
COP: Colour = (16, 18, 22)  # black, drawn with a white rim that carries it on a dark ground
COP_RIM: Colour = (255, 255, 255)
COP_TRAIL: Colour = (120, 124, 130)
TRUE_COP: Colour = (247, 126, 10)  # orange
GROUND_COP: Colour = (176, 62, 2)  # a darker orange: of the contact forces
FOOT_FORCE: Colour = (240, 180, 40)  # amber
REFERENCE: Colour = (20, 84, 200)  # blue
SUPPORT: Colour = (38, 166, 80)  # green
MARGIN: Colour = (20, 112, 52)  # a darker one
REGION: Colour = (96, 140, 214)  # of footholds
DCM: Colour = (122, 64, 232)  # violet
MEASURED_DCM: Colour = (184, 146, 252)  # a lighter one
COMMANDED: Colour = (52, 150, 190)  # a body that is commanded and not there
TWIN: Colour = (150, 158, 170)
PAST: Colour = (96, 165, 130)  # the walk that was
ACTIVE: Colour = (0, 184, 224)  # cyan, for constraints that bind
PUSH: Colour = (200, 20, 164)  # magenta
NEEDED_STEP: Colour = (140, 20, 100)  # a darker one
PUSH_ROSE: Colour = (226, 104, 200)  # a lighter one: of the pushes that would be survived
LEFT_FOOT: Colour = (58, 61, 66)  # the two greys of the footsteps
RIGHT_FOOT: Colour = (122, 125, 130)
GRID_CELL: Colour = (132, 136, 142)
GRID_SECTION: Colour = (112, 117, 124)
GROUND: Colour = (128, 134, 142)
STRIP: Colour = (158, 132, 96)  # wood
FALLEN: Colour = (132, 44, 42)  # mixed into the robot's own colours

# Materials of the URDF, whose own greys are too close to tell the parts of the robot apart.
MATERIALS: dict[str, Colour] = {
    "LightGrey": (214, 217, 221),
    "Grey": (148, 153, 160),
    "DarkGrey": (66, 72, 81),
    "FlatBlack": (38, 40, 44),
    "Orange": (236, 128, 42),
}
DEFAULT_MATERIAL: Colour = (190, 193, 198)


def mixed(one: Colour, other: Colour, share: float) -> Colour:
    """A colour with a share in [0, 1] of another."""
    r, g, b = (round((1.0 - share) * a + share * c) for a, c in zip(one, other, strict=True))
    return r, g, b


def linear(colour: Colour) -> Colour:
    """The colour as light intensities, which viser takes the colours of arrows for."""
    r, g, b = (round(255 * (c / 255) ** 2.2) for c in colour)
    return r, g, b

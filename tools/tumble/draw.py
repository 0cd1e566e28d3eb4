"""What pictures of a run have in common: fields, outlines of bodies, bonds, slices through space, units. Needs numpy; not matplotlib."""

import colorsys

import numpy as np

# unit, colour map, symmetric about zero
FIELDS = {"speed": ("speed", "viridis", False), "vorticity": ("rate", "RdBu_r", True), "pressure": ("pressure", "cividis", False)}
SCALAR = ("scalar", "inferno", False)  # what the flow carries, by its name
UNITS = {
    "cgs": {"length": "cm", "time": "s", "mass": "g"},
    "si": {"length": "m", "time": "s", "mass": "kg"},
    "none": {},
}
# 3 x 3 lattice of a Quadrilateral_9 cell in VTK's order, row by row
LATTICE = np.array([[0, 4, 1], [7, 8, 5], [3, 6, 2]])
TINTS = ["#efeee9", "#f7c59f", "#a8c6ee", "#c3e3a7", "#dfbfe8", "#f4e48f"]  # of groups of bodies
LIVELY = 0.6  # of the largest kinetic energy: the last snapshot is worth showing
MANY_CELLS = 100_000  # beyond, a cell has fewer pixels than triangles are worth
ROUND = np.linspace(0, 2 * np.pi, 181)[:-1]
AXES = "xyz"


def look_of(field):
    """Unit, colour map, symmetric about zero: of a field or of a scalar."""
    return FIELDS.get(field, SCALAR)


def check_field(run, field):
    """A field of the flow, or one of the scalars of the run."""
    known = list(FIELDS) + split_names(run.options.get("scalars", ""))
    if field not in known:
        raise ValueError(f"--field {field}: this run has {', '.join(known)}")


class Units:
    """Words for labels: those that summary.json states, or the ones asked for by name; none otherwise."""

    def __init__(self, run, name=None):
        self.steady = run.options.get("sim_steady", "false") not in ("false", "0", "no", "off")
        base = UNITS[name] if name else run.summary.get("units") or {}
        self.known = dict(base) if isinstance(base, dict) else {}
        length, time, mass = (self.known.get(kind) for kind in ("length", "time", "mass"))
        if length and time:
            self.known["speed"] = f"{length}/{time}"
        if time:
            self.known["rate"] = f"1/{time}"
        if length and time and mass:
            self.known.update(pressure=f"{mass}/({length} {time}²)", force=f"{mass} {length}/{time}²", energy=f"{mass} {length}²/{time}²")

    def __call__(self, kind):
        """' [cm]', or nothing for a run without units."""
        return f" [{self.known[kind]}]" if kind in self.known else ""

    def moment(self, value):
        return "steady" if self.steady else f"t = {value:.4g} {self.known.get('time', '')}".rstrip()


def split_cells(cells):
    """Triangles of Quadrilateral_9 cells: of the four sub-squares, or of the whole cell if there are many."""
    if len(cells) > MANY_CELLS:
        squares = cells[:, [0, 1, 2, 3]]
    else:
        around = [LATTICE[[j, j, j + 1, j + 1], [i, i + 1, i + 1, i]] for j in (0, 1) for i in (0, 1)]
        squares = np.concatenate([cells[:, corners] for corners in around])
    return np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])


def liveliest(run):
    """Step of the snapshot to show where nobody has asked for one: the last, unless the fluid was much faster at another."""
    table = run.series
    if not {"step", "kinetic_energy"} <= set(table):
        return run.steps[-1]
    energy = dict(zip(table["step"].astype(int), table["kinetic_energy"]))
    known = [step for step in run.steps if step in energy]
    best = max(known, key=energy.get, default=run.steps[-1])
    return run.steps[-1] if energy.get(run.steps[-1], 0) >= LIVELY * energy.get(best, 0) else best


def cell_edges(shot):
    """Outlines [cells][9][2] of Quadrilateral_9 cells, with the middles of their edges."""
    return shot.points[shot.cells[:, [0, 4, 1, 5, 2, 6, 3, 7, 0]], :2]


def find_box(shot):
    """Lower and upper corner of the domain."""
    return shot.points[:, : shot.dim].min(0), shot.points[:, : shot.dim].max(0)


def scalars(shot, field, normal=2):
    """Values at the points that a picture shows; of a vorticity in space the component along the axis `normal`."""
    if field == "speed":
        return np.linalg.norm(shot["velocity"], axis=1)
    values = shot[field]
    return values[:, normal] if values.ndim == 2 else values


def seen(shot, field, values):
    """Values that the range of colours goes by: of what the flow carries those outside of bodies and on their surfaces, since bodies cover the rest."""
    if field in FIELDS or "body" not in shot.names:
        return values
    outside = (np.ravel(shot["body"]) < 0)[shot.cells].any(1)
    return values[np.unique(shot.cells[outside])] if outside.any() else values


def colour_range(values, symmetric):
    """The few largest values at corners of bodies would leave no colour for the rest."""
    low, high = np.nanpercentile(values, [0.2, 99.8]) if symmetric else (np.nanmin(values), np.nanmax(values))
    if symmetric:
        high = max(abs(low), abs(high))
        low = -high
    return (low, high) if high > low else (low - 1, low + 1)


# ---- bodies of a plane run ----


def group_tints(run, numbers):
    """A colour for each body, by its group."""
    table = run.bodies
    groups = list(dict.fromkeys(split_names(run.options.get("particle_groups", "")))) or [""]
    first = 0
    owner = {}
    for group in groups:  # bodies are numbered group by group
        count = run.options.get(f"particle_{group}_count")
        if {"body", "group"} <= set(table) and len(table["body"]):
            mine = np.unique(table["body"][table["group"] == group])
            owner.update({int(number): group for number in mine})
        elif count and str(count).isdigit():
            owner.update({number: group for number in range(first, first + int(count))})
            first += int(count)
    return [TINTS[groups.index(owner[number]) % len(TINTS)] if owner.get(number) in groups else TINTS[0] for number in numbers]


def aggregate_tint(number):
    """Colour of the aggregate whose lowest body has this number, the same in all pictures; -1: a body alone."""
    return colorsys.hsv_to_rgb(0.1 + 0.618034 * number % 1, 0.4 + 0.2 * (number * 7 % 3) / 2, 0.95) if number >= 0 else (0.94, 0.93, 0.91)


def body_tints(run, shot, numbers):
    """A colour for each body: by its aggregate where bonds hold bodies together, else by its group."""
    if "aggregate" not in shot.bodies:
        return group_tints(run, numbers)
    aggregate = np.ravel(shot.bodies["aggregate"])
    return [aggregate_tint(int(aggregate[number])) if 0 <= number < len(aggregate) else TINTS[0] for number in numbers]


def find_bonds(run, shot):
    """Lines [n][2][3] of the bonds, with their images across periodic boundaries, and their tensions [n]."""
    if not shot.bonds:
        return np.zeros((0, 2, 3)), np.zeros(0)
    lines, tension = shot.bonds["end"].reshape(-1, 2, 3), np.ravel(shot.bonds["tension"])
    if not shot.has_mesh:
        return lines, tension
    lower, upper = find_box(shot)
    for axis in (AXES.index(a) for a in split_names(run.options.get("mesh_periodic", "")) if a in AXES[: shot.dim]):
        way = (upper - lower)[axis] * np.eye(3)[axis]
        below, above = lines[:, :, axis].min(1) < lower[axis], lines[:, :, axis].max(1) > upper[axis]
        lines, tension = np.concatenate([lines, lines[below] + way, lines[above] - way]), np.concatenate([tension, tension[below], tension[above]])
    return lines, tension


def paths(run, time, periodic, most):
    """Ways [n][2] of the centres of the first `most` bodies up to a time, broken where a body leaves through a periodic boundary."""
    table = run.bodies
    if not {"body", "time", "x", "y"} <= set(table):
        return []
    found = []
    for number in np.unique(table["body"])[:most]:
        rows = table.where((table["body"] == number) & (table["time"] <= time * (1 + 1e-9)))
        way = np.stack([rows["x"], rows["y"]], 1)
        if len(way) > 1:
            length = np.hypot(*np.diff(way, axis=0).T)
            cuts = np.flatnonzero(length > 20 * np.median(length) + 1e-300) + 1 if periodic else []
            found += [part for part in np.split(way, cuts) if len(part) > 1]
    return found


def find_outlines(shot):
    """[(number, points [n][2], centre)] from bodies_<step>.h5, without bodies that have left the domain; circles get as many points as a picture needs."""
    table = shot.bodies
    if "outline" not in table:
        return []
    radius = np.ravel(table["radius"])
    points = table["outline"].reshape(-1, 3)[:, :2]
    lines = points[table["line"]] if "line" in table else points.reshape(len(radius), -1, 2)
    centres = table["position"].reshape(-1, 3)[:, :2] if "position" in table else lines.mean(1)
    owner = np.ravel(table["cell_body"]) if "cell_body" in table else np.arange(len(lines)) if len(lines) == len(radius) else np.full(len(lines), -1)
    first = dict(zip(*np.unique(owner, return_index=True)))  # the body itself, before its images across a period
    found = []
    for k, line in enumerate(lines):
        body = owner[k]
        if body >= 0 and radius[body] <= 0:
            continue
        centre = centres[body] + (line[0] - lines[first[body]][0]) if body >= 0 else line.mean(0)
        arm = line - centre
        if body >= 0 and np.ptp(np.hypot(*arm.T)) < 1e-6 * radius[body]:
            start = np.arctan2(arm[0, 1], arm[0, 0])
            line = centre + np.hypot(*arm[0]) * np.stack([np.cos(start + ROUND), np.sin(start + ROUND)], 1)
            found.append((body, line, centre))
        else:
            found.append((body, line, None))
    return found


def find_discs(run, step, drawn):
    """The same for discs of bodies.csv that have not been drawn: runs without bodies_<step>.h5."""
    table = run.bodies
    if not {"step", "body", "x", "y", "angle", "radius"} <= set(table):
        return []
    rows = table.where((table["step"] == step) & (table["radius"] > 0) & ~np.isin(table["body"], list(drawn)))
    turn = rows["angle"][:, None] + ROUND
    x, y, r = (rows[name][:, None] for name in ("x", "y", "radius"))
    return [(int(body), line, np.array(centre)) for body, line, *centre in zip(rows["body"], np.stack([x + r * np.cos(turn), y + r * np.sin(turn)], 2), rows["x"], rows["y"])]


def add_images(outlines, periodic, lower, upper):
    """What crosses a periodic boundary is seen on both sides of the domain."""
    for axis in (AXES.index(a) for a in periodic if a in AXES[:2]):
        way = np.zeros(2)
        way[axis] = upper[axis] - lower[axis]
        for number, line, centre in list(outlines):
            for sign, out in ((1, line[:, axis].min() < lower[axis]), (-1, line[:, axis].max() > upper[axis])):
                if out:
                    outlines.append((number, line + sign * way, None if centre is None else centre + sign * way))
    return outlines


def plane_bodies(run, shot):
    """Outlines of all bodies of a plane run, with their images across periodic boundaries: [(number, points, centre of a disc or None)]."""
    outlines = find_outlines(shot)
    outlines += find_discs(run, shot.step, {number for number, *_ in outlines})
    if "cell_body" in shot.bodies:  # the file holds the images
        return outlines
    return add_images(outlines, split_names(run.options.get("mesh_periodic", "")), *find_box(shot)) if outlines and shot.has_mesh else outlines


def parabolas(n):
    """The quadratic basis [n][3] of nodes at -1, 0, 1 at n places from -1 to 1."""
    place = np.linspace(-1, 1, n)
    return np.stack([place * (place - 1) / 2, 1 - place**2, place * (place + 1) / 2], 1)


def find_drops(run, shot):
    """Closed lines [n][2] of the interface of drops in a plane run, parabolas on each edge, with their images across periodic boundaries."""
    drops, lines = shot.drops, []
    if "edge" not in drops:
        return []
    shape = parabolas(9)[:-1, [0, 2, 1]]  # of the ends and the middle
    points = np.einsum("kj,ejx->ekx", shape, drops["coordinates"][drops["edge"]][:, :, :2])
    for curve in np.unique(drops["curve"]):
        line = points[drops["curve"] == curve].reshape(-1, 2)
        lines.append((int(curve), np.concatenate([line, line[:1]]), None))
    return [line for _, line, _ in add_images(lines, split_names(run.options.get("mesh_periodic", "")), *find_box(shot))]


def find_solids(run, shot):
    """Edges [9][2] of the outlines of elastic particles in a plane run, parabolas, with their images across periodic boundaries."""
    solids = shot.solids
    if not solids or shot.dim == 3:
        return []
    edges = solids["cells"]  # of membranes
    if edges.shape[1] == 9:
        edges = np.concatenate([edges[:, [i, (i + 1) % 4, 4 + i]] for i in range(4)])
        _, first, count = np.unique(edges[:, 2], return_index=True, return_counts=True)  # those of one cell alone, by their middles
        edges = edges[first[count == 1]]
    points = np.einsum("kj,ejx->ekx", parabolas(9)[:, [0, 2, 1]], solids["coordinates"][edges][:, :, :2])
    lines = [(0, line, None) for line in points]
    return [line for _, line, _ in add_images(lines, split_names(run.options.get("mesh_periodic", "")), *find_box(shot))]


def split_names(text):
    """Words of an option that are separated by commas or blanks."""
    return text.replace(",", " ").split()


# sides of a triquadratic hexahedron in the order of VTK, as biquadratic faces: corners, middles of sides, middle
HEXAHEDRON_SIDES = np.array([[0, 4, 7, 3, 16, 15, 19, 11, 20], [1, 2, 6, 5, 9, 18, 13, 17, 21], [0, 1, 5, 4, 8, 17, 12, 16, 22],
                             [3, 7, 6, 2, 19, 14, 18, 10, 23], [0, 3, 2, 1, 11, 10, 9, 8, 24], [4, 5, 6, 7, 12, 13, 14, 15, 25]])


def material_faces(shot):
    """Faces [n][9][3] (corners, middles of sides, middle) of drops and of elastic particles in space."""
    drops, solids, faces = shot.drops, shot.solids, [np.empty((0, 9, 3))]
    if "face" in drops:
        faces.append(drops["coordinates"][drops["face"]])
    if solids and shot.dim == 3:
        sides = solids["cells"]  # of membranes
        if sides.shape[1] == 27:
            sides = sides[:, HEXAHEDRON_SIDES].reshape(-1, 9)
            _, first, count = np.unique(sides[:, 8], return_index=True, return_counts=True)  # those of one cell alone, by their middles
            sides = sides[first[count == 1]]
        faces.append(solids["coordinates"][sides])
    return np.concatenate(faces)


def material_triangles(shot):
    """Points [n][3] and triangles [m][3] of these faces, each by 4 x 4 pairs."""
    line = parabolas(5)
    shape = np.einsum("ti,sj->tsij", line, line).reshape(25, 9)
    points = np.einsum("kj,ejx->ekx", shape, material_faces(shot)[:, [0, 4, 1, 7, 8, 5, 3, 6, 2]])  # rows of three
    corner = np.array([5 * t + s for t in range(4) for s in range(4)])[:, None]
    cells = np.concatenate([corner + [0, 1, 6], corner + [0, 6, 5]])
    return points.reshape(-1, 3), (25 * np.arange(len(points))[:, None, None] + cells).reshape(-1, 3)


# ---- slices through space ----


class Slice:
    """A field on a plane x, y or z = value: a grid of points, values, and what of the bodies it cuts."""

    FINE = 220  # points along the longer side

    def __init__(self, shot, field, axis, value):
        self.axis, self.value = axis, value
        self.across = [a for a in range(3) if a != axis]
        lower, upper = find_box(shot)
        if not lower[axis] <= value <= upper[axis]:
            raise ValueError(f"the plane {AXES[axis]} = {value:g} lies outside of the domain ({lower[axis]:g} to {upper[axis]:g})")
        self.lower, self.upper = lower[self.across], upper[self.across]
        count = np.maximum(2, np.round((self.upper - self.lower) * self.FINE / (self.upper - self.lower).max()).astype(int))
        self.x, self.y = (np.linspace(a, b, n) for a, b, n in zip(self.lower, self.upper, count))
        self.places = np.empty((len(self.y), len(self.x), 3))
        self.places[..., axis] = value
        self.places[..., self.across[0]], self.places[..., self.across[1]] = np.meshgrid(self.x, self.y)
        if field == "speed":  # of interpolated velocities: a length interpolated may be negative
            self.values = np.linalg.norm(self.sample(shot, shot["velocity"]), axis=2)
        else:
            self.values = self.sample(shot, scalars(shot, field, axis))
        self.seen = self.values  # what the range of colours goes by, as `seen` says
        if field not in FIELDS and "body" in shot.names:
            outside = self.sample(shot, (np.ravel(shot["body"]) >= 0).astype(float)) < 0.9
            self.seen = self.values[outside] if outside.any() else self.values

    def sample(self, shot, values):
        return shot.sample(values, self.places.reshape(-1, 3)).reshape(len(self.y), len(self.x), *values.shape[1:])

    def cut_bodies(self, run, shot):
        """Circles of spheres and outlines of triangulated surfaces [(number, [points][2] or segments [n][2][2])]."""
        found = []
        for number, centre, radius in spheres(run, shot):
            left = radius**2 - (centre[self.axis] - self.value) ** 2
            if left > 0:
                found.append((number, centre[self.across] + np.sqrt(left) * np.stack([np.cos(ROUND), np.sin(ROUND)], 1)))
        surface = triangles(shot, {number for number, *_ in found})
        if surface is not None:
            found.append((None, cut_triangles(*surface, self.axis, self.value)[:, :, self.across]))
        return found

    def cut_material(self, shot):
        """Segments [n][2][2] of the surfaces of drops and elastic particles."""
        return cut_triangles(*material_triangles(shot), self.axis, self.value)[:, :, self.across]


def read_plane(text):
    """'x=0.5' -> (0, 0.5)"""
    axis, _, value = text.partition("=")
    try:
        return AXES.index(axis.strip().lower() or "?"), float(value)
    except ValueError:
        raise ValueError(f"--slice {text} is no plane: write an axis and its value, such as --slice x=0.5") from None


def spheres(run, shot):
    """[(number, centre, radius)] of the bodies whose shape is a circle (sphere)."""
    table = run.bodies
    rows = table.where((table["step"] == shot.step) & (table["radius"] > 0)) if "radius" in table else {}
    return [(int(b), np.array(x), r) for b, r, *x in zip(*(rows[name] for name in ("body", "radius", "x", "y", "z")))] if rows else []


def triangles(shot, without=()):
    """Points [n][3] and triangles [m][3] of the surfaces of bodies, but for those numbered in `without`; None if the run has not written any."""
    table = shot.bodies
    if "surface" not in table or "triangle" not in table:
        return None
    cells = table["triangle"].reshape(-1, 3).astype(int)
    if without and "cell_body" in table:
        cells = cells[~np.isin(np.ravel(table["cell_body"]), list(without))]
    return table["surface"].reshape(-1, 3), cells


def cut_triangles(points, cells, axis, value):
    """Segments [n][2][3] in which triangles meet the plane."""
    height = points[:, axis] - value
    height = np.where(height == 0, 1e-300, height)
    segments = []
    for a, b, c in cells[np.ptp(np.sign(height[cells]), axis=1) > 0]:
        ends = [(i, j) for i, j in ((a, b), (b, c), (c, a)) if height[i] * height[j] < 0 or np.sign(height[i]) != np.sign(height[j])]
        segments.append([points[i] + (points[j] - points[i]) * height[i] / (height[i] - height[j]) for i, j in ends])
    return np.array(segments).reshape(-1, 2, 3)


def gravity(run):
    """Direction of gravity [3], zero without; runs that left no options fall along y."""
    if not run.options:
        return np.array([0.0, -1.0, 0.0])
    words = split_names(run.options.get("flow_gravity", ""))
    vector = np.zeros(3)
    vector[: len(words)] = [float(word) for word in words]
    return vector / (np.linalg.norm(vector) or 1)


def choose_plane(run, shot, body=None):
    """Axis and value of the plane through a body (the largest one, or the middle of the domain) that holds gravity and the longer sides."""
    lower, upper = find_box(shot)
    down = abs(gravity(run))
    axis = min(range(3), key=lambda a: (down[a] > 0.5, round((upper - lower)[a], 9), -a if a < 2 else 1))
    position, radius = shot.bodies.get("position"), np.ravel(shot.bodies.get("radius", []))
    if body is None and len(radius):
        body = int(np.argmax(radius))
    if body is None:
        return axis, (lower + upper)[axis] / 2
    if not 0 <= body < len(radius):
        raise ValueError(f"there is no body {body} (they are 0 to {len(radius) - 1})")
    return axis, float(np.clip(position.reshape(-1, 3)[body, axis], lower[axis], upper[axis]))

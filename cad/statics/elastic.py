"""Linear elasticity on a grid of cells partly filled by a body (finite cells): no mesh of the body is needed.

Every cell is a hexahedron of 20 nodes, its stiffness the sum over its small cubes inside the body (Parvizian, Duester,
Rank 2007); clamped surfaces are held by springs. Millimetres, newtons, MPa.

Not scikit-fem 12: it sums over 1728 points for every cell, 3.1 s for 8 cells, compared with 0.5 s here for 986.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from scanwright.design.arrays import Array, Mask
from scanwright.design.scene import ray_caster

OUTSIDE = 1e-4  # stiffness of a cut cell's cubes outside the body, of that inside: keeps its nodes in place
HOLD = 20.0  # stiffness per area of a clamp, of modulus by edge: softens by about 1e-3
LATTICE = np.array([[i, j, k] for i in range(3) for j in range(3) for k in range(3)])
NODES = LATTICE[(LATTICE == 1).sum(axis=1) < 2]  # corners and middles of edges, in half edges from the corner, (20, 3)
RAYS = 2  # through a cube, along x and along y: a wall as thin as a cube keeps its thickness
SURFACES = 64  # that one column may pass
PAST_M = 1e-7  # beyond a surface that was hit


@dataclass(frozen=True, slots=True)
class Grid:
    """Cubic cells, each of `parts` cubes along an edge."""

    low: Array  # corner of the first cell [mm], shape (3,)
    edge: float  # of a cell [mm]
    shape: tuple[int, int, int]  # cells along x, y, z
    parts: int  # cubes along the edge of a cell

    def middles(self, axis: int) -> Array:
        """Return middles of the cubes along one axis [mm]."""
        return self.low[axis] + self.edge * (np.arange(self.shape[axis] * self.parts) + 0.5) / self.parts


def filled(triangles: Array, grid: Grid) -> Array:
    """Return the share of each cube inside a closed surface: exact along z, the mean of RAYS x RAYS lines across it.

    Triangles (t, 3, 3) [mm] are counter-clockwise from outside; the result has shape (nx, ny, nz) * parts.
    """
    solid = ray_caster.build_scene(triangles / 1000)
    below = min(float(grid.low[2]), float(triangles[:, :, 2].min())) - 1.0
    offsets = ((np.arange(RAYS) + 0.5) / RAYS - 0.5) * grid.edge / grid.parts
    return np.mean([_along_lines(solid, grid, below, dx, dy) for dx in offsets for dy in offsets], axis=0)


def _along_lines(solid: ray_caster.Scene, grid: Grid, below: float, dx: float, dy: float) -> Array:
    """Share of one line through each cube that is inside, its shift from the middle given."""
    x, y = grid.middles(0) + dx, grid.middles(1) + dy
    columns = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2).reshape(-1, 2)
    height = np.full(len(columns), below)
    cube, levels = grid.edge / grid.parts, grid.shape[2] * grid.parts
    change = np.zeros((len(columns), levels + 2))
    left = np.arange(len(columns))
    for _ in range(SURFACES):
        origins = np.column_stack([columns[left], height[left]]) / 1000
        hits = ray_caster.cast(solid, origins, np.broadcast_to([0.0, 0.0, 1.0], origins.shape))
        met = hits.triangle >= 0
        left = left[met]
        if len(left) == 0:
            break
        height[left] += 1000 * hits.range_m[met]
        place = np.clip((height[left] - grid.low[2]) / cube, 0.0, levels)
        level = np.minimum(place.astype(np.intp), levels - 1)
        sense = np.where(solid.normals[hits.triangle[met], 2] < 0, 1.0, -1.0)
        beyond = level + 1.0 - place
        change[left, level] += sense * beyond
        change[left, level + 1] += sense * (1.0 - beyond)
        height[left] += 1000 * PAST_M
    share = np.clip(np.cumsum(change, axis=1)[:, :levels], 0.0, 1.0)
    return share.reshape(len(x), len(y), levels)


@dataclass(frozen=True, slots=True)
class Model:
    """A body on a grid."""

    grid: Grid  # the cells
    cells: NDArray[np.intp]  # index of every cell that holds some of the body, shape (m, 3)
    share: Array  # of each of their cubes that the body fills, shape (m, parts^3)
    nodes: NDArray[np.intp]  # node number of each node of each cell, shape (m, 20)
    count: int  # number of nodes n


@dataclass(frozen=True, slots=True)
class Places:
    """Points in a body: the cell of each (row of `Model.cells`) and its shape functions, shape (p,) and (p, 20).

    `known` marks the requested points that are in a cell.
    """

    cell: NDArray[np.intp]
    shapes: Array
    known: Mask


def model_of(grid: Grid, body: Array) -> Model:
    """Return the cells of a body, from the filled share of each cube (`voxels.filled`)."""
    (x, y, z), p = grid.shape, grid.parts
    share = body.reshape(x, p, y, p, z, p).transpose(0, 2, 4, 1, 3, 5).reshape(x, y, z, p**3)
    cells = np.argwhere(share.any(axis=3))
    size = 2 * np.array(grid.shape) + 1
    lattice = 2 * cells[:, None, :] + NODES
    numbers = (lattice[..., 0] * size[1] + lattice[..., 1]) * size[2] + lattice[..., 2]
    used, nodes = np.unique(numbers, return_inverse=True)
    return Model(grid, cells, share[tuple(cells.T)], nodes.reshape(numbers.shape), len(used))


def places(model: Model, points: Array) -> Places:
    """Return the cells of points [mm], shape (p, 3); a point between two cells belongs to the lower one."""
    grid = model.grid
    number = np.full(grid.shape, -1)
    number[tuple(model.cells.T)] = np.arange(len(model.cells))
    at = (points - grid.low) / grid.edge
    corner = np.clip(np.ceil(at - 1e-9).astype(np.intp) - 1, 0, np.array(grid.shape) - 1)
    cell = number[tuple(corner.T)]
    known = cell >= 0
    return Places(cell[known], _shapes_and_slopes((at - corner)[known])[0], known)


def solve(model: Model, modulus: float, poisson: float, clamped: Places, clamped_mm2: float, loads: Array) -> Array:
    """Return the displacements of all nodes [mm] by loads (n, 3, cases) [N].

    `clamped` are points spread evenly over the surface that cannot move, whose area is `clamped_mm2`.

    Raises:
        RuntimeError: nothing holds the body.
    """
    cubes = _of_cubes(model.grid.parts, poisson)
    matrices = (modulus * model.grid.edge * ((model.share + OUTSIDE) @ cubes)).reshape(-1, 20, 3, 20, 3)
    spring = HOLD * modulus / model.grid.edge * clamped_mm2 / len(clamped.cell)
    springs = spring * clamped.shapes[:, :, None] * clamped.shapes[:, None, :]
    for axis in range(3):
        np.add.at(matrices[:, :, axis, :, axis], clamped.cell, springs)
    stiffness = _summed(model.nodes, matrices, model.count)
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    factors = splu(stiffness.tocsc(), **options)
    return np.asarray(factors.solve(loads.reshape(-1, loads.shape[2])).reshape(loads.shape))


def weight(model: Model, per_mm3: Array) -> Array:
    """Return loads (n, 3, cases) of forces per volume [N/mm3] on the body, shape (3, cases)."""
    cube = (model.grid.edge / model.grid.parts) ** 3
    share = model.share @ _shapes_and_slopes(_middles(model.grid.parts))[0] * cube
    loads = np.zeros((model.count, *per_mm3.shape))
    np.add.at(loads, model.nodes, share[:, :, None, None] * per_mm3)
    return loads


def pull(model: Model, at: Places, forces: Array) -> Array:
    """Return loads (n, 3, cases) of forces on points [N], shape (p, 3, cases)."""
    loads = np.zeros((model.count, *forces.shape[1:]))
    np.add.at(loads, model.nodes[at.cell], at.shapes[:, :, None, None] * forces[:, None])
    return loads


def moved(model: Model, at: Places, displacements: Array) -> Array:
    """Return displacements of points, shape (p, 3, cases), from those of the nodes."""
    return np.asarray(np.einsum("pa,paic->pic", at.shapes, displacements[model.nodes[at.cell]]))


def lumps(model: Model, density_g_cm3: float) -> tuple[Array, Array, Array]:
    """Return the mass of each cell's share of the body [kg], its centre [mm], and the shape functions' means over it.

    Shapes (m,), (m, 3) and (m, 20).
    """
    middles, filled = _middles(model.grid.parts), model.share.sum(axis=1)
    cube = (model.grid.edge / model.grid.parts) ** 3
    centres = model.grid.low + model.grid.edge * (model.cells + model.share @ middles / filled[:, None])
    return density_g_cm3 * 1e-6 * cube * filled, centres, model.share @ _shapes_and_slopes(middles)[0] / filled[:, None]


def _middles(parts: int) -> Array:
    """Return centres of the cubes of a cell of edge 1, shape (parts^3, 3)."""
    along = (np.arange(parts) + 0.5) / parts
    return np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=3).reshape(-1, 3)


def _shapes_and_slopes(points: Array) -> tuple[Array, Array]:
    """Return quadratic shape functions of a cell of edge 1 and their derivatives, shape (p, 20) and (p, 20, 3)."""
    at, nodes = 2 * points[:, None, :] - 1, NODES - 1.0  # -1 to 1
    on_edge = nodes == 0
    side = np.where(on_edge, 1 - at**2, (1 + at * nodes) / 2)
    slope = np.where(on_edge, -2 * at, nodes / 2)
    corner = ~on_edge.any(axis=1)
    plain = side.prod(axis=2)
    plain_slopes = np.stack([slope[:, :, a] * np.delete(side, a, axis=2).prod(axis=2) for a in range(3)], axis=2)
    last = np.where(corner, (at * nodes).sum(axis=2) - 2, 1.0)
    slopes = plain_slopes * last[:, :, None] + np.where(corner[:, None], plain[:, :, None] * nodes, 0.0)
    return plain * last, 2 * slopes


@cache
def _of_cubes(parts: int, poisson: float) -> Array:
    """Return the stiffness of every cube of a cell of edge 1 and modulus 1, shape (parts^3, 3600); 8 points each."""
    lame, shear = poisson / (1 + poisson) / (1 - 2 * poisson), 0.5 / (1 + poisson)
    stiff = np.zeros((parts**3, 20, 3, 20, 3))
    share = 1 / parts**3 / 8
    for shift in (LATTICE[(LATTICE != 1).all(axis=1)] - 1.0) / np.sqrt(12) / parts:
        _, g = _shapes_and_slopes(_middles(parts) + shift)
        stiff += share * lame * np.einsum("cai,cbj->caibj", g, g)
        stiff += share * shear * np.einsum("caj,cbi->caibj", g, g)
        along = share * shear * np.einsum("cak,cbk->cab", g, g)
        for axis in range(3):
            stiff[:, :, axis, :, axis] += along
    stiff.flags.writeable = False  # kept for all grids
    return stiff.reshape(parts**3, -1)


def _summed(nodes: NDArray[np.intp], matrices: Array, count: int) -> sparse.bsr_matrix:
    """Return the sparse matrix of 3 x 3 blocks, equal places summed in a fixed order."""
    blocks = matrices.transpose(0, 1, 3, 2, 4).reshape(-1, 3, 3)
    rows, columns = np.repeat(nodes, 20, axis=1).reshape(-1), np.tile(nodes, (1, 20)).reshape(-1)
    key = rows * count + columns
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    data = np.add.reduceat(blocks[order], first, axis=0)
    starts = np.searchsorted(rows[order][first], np.arange(count + 1))
    return sparse.bsr_matrix((data, columns[order][first], starts), shape=(3 * count, 3 * count), blocksize=(3, 3))

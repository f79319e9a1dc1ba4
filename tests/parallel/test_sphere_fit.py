"""Of the Gauss images that touch the sphere, the one to which the mesh is most nearly minimal."""

import numpy as np

from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.curvature import pair_curvatures, pair_mixed_areas
from phexfab.parallel.space import parallel_space
from phexfab.parallel.sphere_fit import _mixed_area_rows, fit_to_sphere
from phexfab.surface.catalog import surface

SMOOTH = surface("enneper").scaled(1000.0)
SHELL = minimal_shell(SMOOTH, lattice_on(SMOOTH, 150.0), "vertex")
MESH, S = SHELL.mesh, SHELL.gauss


def test_the_rows_give_the_normalised_mixed_areas():
    rng = np.random.default_rng(0)
    space = parallel_space(MESH)
    member = space.member(rng.normal(size=space.dimension))
    found = _mixed_area_rows(MESH, S.vertices) @ member.vertices.ravel()
    areas = np.abs(pair_mixed_areas(MESH, MESH) * pair_mixed_areas(S, S))
    wanted = pair_mixed_areas(MESH, member) / np.sqrt(areas)
    assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()


def test_a_little_minimality_picks_a_better_image_of_the_family():
    space = parallel_space(MESH)
    plain = fit_to_sphere(space, "vertex")
    picked = fit_to_sphere(space, "vertex", plain.gauss, 200, minimal=0.1)
    before = pair_curvatures(MESH, plain.gauss).minimality.max()
    after = pair_curvatures(MESH, picked.gauss).minimality.max()
    assert plain.worst < 1e-12 and picked.worst < 1e-5
    assert after < before / 5
    # From the shell's own Gauss image nothing is left to gain.
    own = fit_to_sphere(space, "vertex", S, minimal=0.1)
    assert own.worst < 1e-13 and pair_curvatures(MESH, own.gauss).minimality.max() < 1e-12

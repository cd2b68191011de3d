"""Eccentric cylinders, cavity and manufactured fields: closed forms checked from outside, nodes, errors, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import LAWS, setup
from nlsolve_laws import Bingham, NortonHoff, PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_scenes import Cavity, EccentricCylinders, Manufactured
from nlsolve_scenes.formulas import FUNCTIONS, Jet, formula
from nlsolve_scenes.nodes.grading import lines, relative_spacing
from pydantic import ValidationError
from scipy.spatial import cKDTree

from nlsolve import SolveError, Status
from nlsolve.contracts.continuum.law import stress
from nlsolve.plugin import ConstitutiveLaw, FlowScene, Misfit, NodeMotion, Physics
from nlsolve.registry.problems import StudyError
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march
from nlsolve.study.study import Study
from nlsolve.testing import check_scene

VISCOUS = NortonHoff(consistency=1.0, index=1.0)  # μ = 1 MPa s
SCENES: list[FlowScene] = [
    EccentricCylinders(),
    EccentricCylinders(eccentricity=0.01),
    EccentricCylinders(eccentricity=0.95, inner_spin=-30.0, outer_spin=20.0),
    EccentricCylinders(inner_radius=5.0, outer_radius=5.5, eccentricity=0.2, jitter=0.2, seed=3),
    Cavity(),
    Cavity(side=3.0, lid="smooth", nodes="grid", jitter=0.2, spacing=0.2),
    Cavity(grading=0.5),
    Manufactured(),
    Manufactured(width=2.0, origin=(-1.0, 3.0), nodes="scattered", grading=0.6),
    Manufactured(grading=0.6, jitter=0.3),
]


@pytest.mark.parametrize("scene", SCENES, ids=repr)
@pytest.mark.parametrize("index", [1.0, 0.3])
def test_scenes_conform(scene: FlowScene, index: float) -> None:
    check_scene(scene, PowerLaw(index=index))


def solved(scene: FlowScene, law: ConstitutiveLaw, physics: Physics) -> dict[str, Any]:
    row = march(setup(scene, law=law, physics=physics, linear=SuperLU())).summary
    assert row["status"] == "converged", row["message"]
    return row


ITERATED = Physics(penalty=1e3, divergence_tolerance=1e-7)


# Eccentric cylinders: the closed form.

BEARINGS = [
    EccentricCylinders(),
    EccentricCylinders(inner_spin=-3.0, outer_spin=2.0),
    EccentricCylinders(eccentricity=0.7, inner_spin=0.0, outer_spin=1.0),
    EccentricCylinders(eccentricity=0.02),
]


def velocity(scene: FlowScene, points: Array) -> Array:
    """The exact velocity at points (..., 2) for μ = 1."""
    exact = scene.exact(VISCOUS, points.reshape(-1, 2), 0.0)
    assert exact is not None
    return exact.velocity.reshape(points.shape)


def slopes(field: Any, points: Array, h: float = 2e-3) -> Array:
    """∂/∂x and ∂/∂y of a field of points, by differences of fourth order, stacked first."""
    return np.array(
        [
            sum(weight * field(points + step * h * axis) for step, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1)))
            / (12.0 * h)
            for axis in np.eye(2)
        ]
    )


@pytest.mark.parametrize("scene", BEARINGS, ids=repr)
def test_no_flux_and_a_harmonic_vorticity(scene: EccentricCylinders) -> None:
    """∮ V·n ds = 0 and ∮ V·t ds/(π R²), the mean vorticity of a disc, the same for two discs about a point: div V = 0
    and ∇²∇²ψ = 0.
    """
    angle = 2.0 * np.pi * np.arange(64) / 64
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = np.stack([-n[:, 1], n[:, 0]], axis=1)
    speed = abs(scene.inner_spin) + abs(scene.outer_spin)
    for centre in ([1.6, 0.4], [0.2, 1.4], [-1.1, 0.3], [1.5, -0.9]):
        flux, mean = [], []
        for radius in (0.05, 0.1):
            v = velocity(scene, np.array(centre) + radius * n)
            flux.append(2.0 * np.pi * radius * np.mean((v * n).sum(axis=1)))
            mean.append(2.0 / radius * np.mean((v * t).sum(axis=1)))
        np.testing.assert_allclose(flux, 0.0, atol=1e-12 * speed)
        assert mean[0] == pytest.approx(mean[1], abs=1e-10 * speed)


@pytest.mark.parametrize("scene", BEARINGS, ids=repr)
def test_torque_and_force_are_those_of_the_traction_of_the_field(scene: EccentricCylinders) -> None:
    """−∮ x × σn ds and −∮ σn ds on a circle around the inner wall, by differences of the exact field. The pressure
    follows from dp/ds = μ ∂ω/∂n and comes back to itself.
    """
    count, radius = 256, 1.15
    angle = 2.0 * np.pi * np.arange(count) / count
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points, ds = radius * n, 2.0 * np.pi * radius / count

    def gradient(x: Array) -> Array:
        return slopes(lambda z: velocity(scene, z), x)  # [j, point, i] = ∂V_i/∂x_j

    def vorticity(x: Array) -> Array:
        g = gradient(x)
        return g[0, :, 1] - g[1, :, 0]

    g = gradient(points)
    along = np.einsum("jp,pj->p", slopes(vorticity, points), n)
    spectrum, wave = np.fft.rfft(along), np.arange(count // 2 + 1)
    assert abs(spectrum[0]) < 1e-5 * np.abs(spectrum).max()
    pressure = radius * np.fft.irfft(np.concatenate([[0.0], spectrum[1:] / (1j * wave[1:])]), count)
    traction = np.einsum("jpi,pj->pi", g, n) + np.einsum("ipj,pj->pi", g, n) - pressure[:, None] * n
    exact = scene.exact(VISCOUS, points, 0.0)
    assert exact is not None
    moment = points[:, 0] * traction[:, 1] - points[:, 1] * traction[:, 0]
    force, torque = -ds * traction.sum(axis=0), -ds * moment.sum()
    expected = exact.quantities
    size = abs(expected["torque"])
    np.testing.assert_allclose(force, [expected["force_x"], expected["force_y"]], atol=1e-6 * size)
    assert torque == pytest.approx(expected["torque"], abs=1e-6 * size)


@pytest.mark.parametrize("part", [0.2, 0.5, 0.8])
def test_a_narrow_gap_is_lubricated(part: float) -> None:
    """Sommerfeld (1904), clearance C, e = ε C: force 12π μ ω r³ ε/(C² (2 + ε²) √(1 − ε²)) and torque
    4π μ ω r³ (1 + 2 ε²)/(C (2 + ε²) √(1 − ε²)), up to the order of C/r.
    """
    gap = 2e-3
    scene = EccentricCylinders(inner_radius=1.0, outer_radius=1.0 + gap, eccentricity=part * gap, inner_spin=1.0)
    exact = scene.exact(VISCOUS, np.array([[1.0, 0.0]]), 0.0)
    assert exact is not None
    common = (2.0 + part**2) * np.sqrt(1.0 - part**2)
    assert abs(exact.quantities["force_y"]) == pytest.approx(12.0 * np.pi * part / (gap**2 * common), rel=5 * gap)
    assert exact.quantities["torque"] == pytest.approx(
        4.0 * np.pi * (1.0 + 2.0 * part**2) / (gap * common), rel=5 * gap
    )


def test_a_small_eccentricity_is_nearly_couette() -> None:
    """Torque 4π μ ω r_i² r_o²/(r_o² − r_i²), up to the order of e²."""
    exact = EccentricCylinders(eccentricity=0.01).exact(VISCOUS, np.array([[1.5, 0.0]]), 0.0)
    assert exact is not None
    assert exact.quantities["torque"] == pytest.approx(4.0 * np.pi * 100.0 * 4.0 / 3.0, rel=1e-4)
    assert EccentricCylinders().exact(PowerLaw(index=0.5), np.array([[1.5, 0.0]]), 0.0) is None
    assert EccentricCylinders().exact(Bingham(), np.array([[1.5, 0.0]]), 0.0) is None


# Eccentric cylinders: nodes and errors.


@pytest.mark.parametrize("eccentricity", [0.05, 0.5, 0.8])
@pytest.mark.parametrize("grading", [1.0, 0.5])
def test_both_walls_are_fitted_and_both_gaps_resolved_alike(eccentricity: float, grading: float) -> None:
    scene = EccentricCylinders(eccentricity=eccentricity, grading=grading)
    cloud = scene.cloud(VISCOUS)
    inner, outer = (cloud.nodes[cloud.boundaries[name]] for name in ("inner", "outer"))
    np.testing.assert_allclose(np.hypot(*inner.T), 1.0, rtol=1e-13)
    np.testing.assert_allclose(np.hypot(outer[:, 0] - eccentricity, outer[:, 1]), 2.0, rtol=1e-13)
    radius = np.hypot(*cloud.nodes[cloud.interior].T)
    assert radius.min() > 1.0
    assert np.hypot(*(cloud.nodes[cloud.interior] - [eccentricity, 0.0]).T).max() < 2.0
    poles = scene._poles
    z = cloud.nodes[:, 0] + poles.d + 1j * cloud.nodes[:, 1]
    level = np.log(np.abs(z - poles.c) / np.abs(z + poles.c))
    assert len(np.unique(np.round(level, 9))) == round((1.0 + eccentricity) / 0.1) + 1
    nearest = cloud.nearest_distance
    around = cKDTree(cloud.nodes).query(cloud.nodes[cloud.interior], 9)[1]
    assert (nearest[around].max(axis=1) / nearest[cloud.interior]).max() < 1.8  # neighbours' distances differ little


def test_graded_lines_grow_by_one_factor_from_both_ends() -> None:
    t = lines(20, 0.25)
    gaps = np.diff(t)
    np.testing.assert_allclose(gaps, gaps[::-1], rtol=1e-12)
    np.testing.assert_allclose(gaps[1:10] / gaps[:9], gaps[1] / gaps[0], rtol=1e-12)
    np.testing.assert_allclose(t[[0, 10, 20]], [0.0, 0.5, 1.0], atol=1e-15)
    assert relative_spacing(np.array([0.0]), 0.25)[0] / relative_spacing(np.array([0.5]), 0.25)[0] == 0.25
    np.testing.assert_allclose(lines(20, 1.0 - 1e-9), lines(20, 1.0), atol=1e-8)


class TestSteadyBearing:
    """Default nodes, 2560 of them: velocity within 0.1 %, torque within 0.1 %, force within 0.3 % at λ/μ = 1e4."""

    def test_velocity_torque_and_force(self) -> None:
        row = solved(EccentricCylinders(), PowerLaw(index=1.0), Physics(penalty=1e4))
        assert row["velocity_error"] <= 1e-3
        assert row["torque_error"] <= 1e-3
        assert row["force_error"] <= 3e-3

    def test_finer_nodes_and_an_iterated_pressure(self) -> None:
        row = solved(EccentricCylinders(spacing=0.075), PowerLaw(index=1.0), ITERATED)
        assert row["divergence"] <= 1e-7
        assert row["velocity_error"] <= 1e-3
        assert row["torque_error"] <= 1e-3
        assert row["force_error"] <= 4e-3


# Cavity.


def centre_lines(scene: Cavity, x: Array, y: Array, law: ConstitutiveLaw) -> Array:
    """V at the places (x, y)."""
    physics = Physics(penalty=1000.0, divergence_tolerance=1e-6)
    case = setup(scene, law=law, physics=physics, linear=SuperLU())
    fields = march(case).fields
    values = case.discretizer.values(fields[["x", "y"]].to_numpy(), np.stack([x, y], axis=1))
    return values @ fields[["u", "v"]].to_numpy()


def test_creeping_flow_in_a_cavity_is_symmetric_about_its_middle() -> None:
    """u(x) = u(L − x), v(x) = −v(L − x) to 1.5 % of the lid's speed; the vortex lies at y = 0.765 L.

    Shankar & Deshpande (2000).
    """
    x, y = (place.ravel() for place in np.meshgrid(np.linspace(0.1, 0.5, 9), np.linspace(0.1, 0.8, 9)))
    scene = Cavity(spacing=1 / 32)
    left, right = np.split(centre_lines(scene, np.concatenate([x, 1.0 - x]), np.tile(y, 2), VISCOUS), 2)
    np.testing.assert_allclose(left, right * [1.0, -1.0], atol=0.015)
    y = np.linspace(0.6, 0.9, 61)
    u = centre_lines(scene, np.full_like(y, 0.5), y, VISCOUS)[:, 0]
    assert np.interp(0.0, u, y) == pytest.approx(0.765, abs=0.005)


def test_the_lid_moves_and_its_corners_do_not() -> None:
    for lid in ("plain", "smooth"):
        scene = Cavity(lid=lid, side=2.0, lid_speed=3.0, spacing=0.1, nodes="grid")
        cloud = scene.cloud(VISCOUS)
        held = np.zeros_like(cloud.nodes)
        held[cloud.boundary] = scene.boundary_velocity(cloud, VISCOUS, 0.0)
        x = cloud.nodes[cloud.boundaries["top"], 0]
        np.testing.assert_allclose(cloud.nodes[cloud.boundaries["top"], 1], 2.0)
        expected = np.where((x > 0.0) & (x < 2.0), 3.0, 0.0) if lid == "plain" else 3.0 * x**2 * (2.0 - x) ** 2
        np.testing.assert_allclose(held[cloud.boundaries["top"], 0], expected, rtol=1e-13, atol=1e-15)
        assert np.count_nonzero(held) == len(x) - 2
    assert Cavity(side=2.0, lid_speed=3.0).reynolds(VISCOUS, 100.0) == pytest.approx(600.0)


# Formulas.


def test_formulas_are_numpys() -> None:
    x, y = np.random.default_rng(0).uniform(0.5, 1.5, (2, 5))
    np.testing.assert_allclose(formula("2*x**2 - y/3 + -x*y")(x, y), 2 * x**2 - y / 3 - x * y, rtol=1e-14)
    np.testing.assert_allclose(formula(" pi*x**(1/2) + e**-2 ")(x, y), np.pi * np.sqrt(x) + np.exp(-2), rtol=1e-14)
    np.testing.assert_array_equal(formula("3")(x, y), np.full(5, 3.0))
    for name, function in FUNCTIONS.items():
        np.testing.assert_allclose(formula(f"+{name}(x*y)")(x, y), function(x * y), rtol=1e-14)


def test_derivatives_of_a_formula() -> None:
    x, y = points = np.random.default_rng(1).uniform(0.5, 1.5, (2, 7))
    jet = Jet.of("sin(x*y) + x**3*log(y)", points.T)
    s, c = np.sin(x * y), np.cos(x * y)
    np.testing.assert_allclose(jet.f, s + x**3 * np.log(y), rtol=1e-13)
    np.testing.assert_allclose(jet.x, y * c + 3 * x**2 * np.log(y), rtol=1e-13)
    np.testing.assert_allclose(jet.y, x * c + x**3 / y, rtol=1e-13)
    np.testing.assert_allclose(jet.xx, -(y**2) * s + 6 * x * np.log(y), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(jet.xy, c - x * y * s + 3 * x**2 / y, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(jet.yy, -(x**2) * s - x**3 / y**2, rtol=1e-12, atol=1e-12)


FORBIDDEN = {
    "z*x": "'z' is not allowed in a formula; it may hold numbers, x, y, pi, e",
    "abs(x)": r"'abs\(x\)' is not allowed",
    "sin(x, y)": r"'sin\(x, y\)' is not allowed",
    "__import__('os').system('ls')": "is not allowed",
    "x.real": "'x.real' is not allowed",
    "x if y else 1": "is not allowed",
    "x // y": "'x // y' is not allowed",
    "not x": "'not x' is not allowed",
    "True": "'True' is not allowed",
    "1j*x": "'1j' is not allowed",
    "x**y": r"'x \*\* y': an exponent must be a number; write exp\(b\*log\(a\)\)",
    "2*": r"'2\*' is not a formula \(invalid syntax\)",
    "": "'' is not a formula",
    "+".join(["x"] * 300): "at most 500 characters",
}


@pytest.mark.parametrize("text", FORBIDDEN)
def test_what_is_no_formula_is_refused_by_name(text: str) -> None:
    with pytest.raises(ValidationError, match=FORBIDDEN[text]):
        Manufactured(u=text)


# Manufactured fields.


@pytest.mark.parametrize("kind", LAWS)
def test_the_body_force_balances_stress_pressure_and_convection(kind: str) -> None:
    """f = ρ (V·∇)V − div S + ∇p, with S and V differentiated by differences."""
    law = LAWS[kind]
    scene, physics = Manufactured(), Physics(penalty=1.0, convection=True, density=2.0)
    points = np.random.default_rng(2).uniform(0.1, 0.9, (6, 2))

    def v(x: Array) -> Array:
        return scene.exact(law, x, 0.0).velocity

    def stresses(x: Array) -> Array:
        g = slopes(v, x)
        return stress(law, np.stack([g[0, :, 0], g[1, :, 1], 0.5 * (g[1, :, 0] + g[0, :, 1])])).T

    def pressure(x: Array) -> Array:
        return 20.0 * np.cos(x[:, 0]) * x[:, 1]

    s = slopes(stresses, points)
    divergence = np.stack([s[0, :, 0] + s[1, :, 2], s[0, :, 2] + s[1, :, 1]], axis=1)
    carried = np.einsum("pj,jpi->pi", v(points), slopes(v, points))
    expected = 2.0 * carried - divergence + slopes(pressure, points).T
    force = scene.body_force(points, law, physics)
    np.testing.assert_allclose(force, expected, atol=1e-6 * np.abs(expected).max())
    plain = scene.body_force(points, law, Physics(density=2.0))
    np.testing.assert_allclose(plain, -divergence, atol=1e-6 * np.abs(divergence).max())


class TestOrderOfConvergence:
    """Quadratic moving least squares: second order on any nodes, with an iterated pressure or without one."""

    least = 1.8
    spacings = (0.1, 0.05)

    @pytest.mark.parametrize("index", [1.0, 0.5])
    @pytest.mark.parametrize("nodes", [{}, {"jitter": 0.2}, {"nodes": "scattered"}], ids=str)
    def test_velocity(self, nodes: dict[str, Any], index: float) -> None:
        self.falls(nodes, Physics(), index, self.least)

    @pytest.mark.parametrize("index", [1.0, 0.5])
    def test_with_a_pressure(self, index: float) -> None:
        self.falls({"nodes": "scattered"}, ITERATED, index, self.least)

    def falls(self, nodes: dict[str, Any], physics: Physics, index: float, least: float) -> None:
        law = PowerLaw(index=index)
        rows = [solved(Manufactured(spacing=h, **nodes), law, physics) for h in self.spacings]
        errors = [row["velocity_error"] for row in rows]
        assert errors[-1] < 1e-3
        assert np.log2(errors[0] / errors[1]) >= least


def test_a_penalty_alone_leaves_an_error_of_its_own() -> None:
    """O(p/λ): ten times less with ten times the penalty, and gone where the pressure is iterated."""
    scene, law = Manufactured(p="2000*cos(x)*y", nodes="scattered", spacing=0.1), PowerLaw(index=1.0)
    weak, strong = (solved(scene, law, Physics(penalty=penalty))["velocity_error"] for penalty in (10.0, 100.0))
    iterated = solved(scene, law, Physics(penalty=100.0, divergence_tolerance=1e-7))["velocity_error"]
    assert (weak - iterated) / (strong - iterated) == pytest.approx(10.0, rel=0.4)
    assert weak > 5.0 * iterated


def test_no_viscosity_at_rest_is_no_body_force() -> None:
    """u = y² is not strained at y = 0, where μ ~ ε̄^(n−1) has no end."""
    scene = Manufactured(u="y**2", v="0", origin=(0.0, -0.5))
    with pytest.raises(SolveError, match=r"'power-law' gives no finite divergence of stress at \(0.25, 0\)") as ending:
        scene.body_force(np.array([[0.1, 0.2], [0.25, 0.0]]), PowerLaw(index=0.5, regularization=0.0), Physics())
    assert ending.value.status is Status.NON_FINITE


# Scenes that make no sense.

NONSENSE: list[tuple[type[Any], dict[str, Any], str]] = [
    (EccentricCylinders, {"eccentricity": 1.0}, r"eccentricity = 1 mm: it must be smaller than .* = 1 mm, or the cyl"),
    (EccentricCylinders, {"inner_radius": 3.0}, "or the cylinders touch"),
    (EccentricCylinders, {"eccentricity": 1e-3}, 'less than 0.01 of the mean gap of 1 mm: use the scene "couette"'),
    (EccentricCylinders, {"inner_spin": 0.0}, "nothing moves; let one of them spin"),
    (EccentricCylinders, {"grading": 1.5}, "less than or equal to 1"),
    (Cavity, {"lid": "rough"}, "'plain' or 'smooth'"),
    (Manufactured, {"jitter": 0.5}, "less than 0.5"),
    (Manufactured, {"u": "x", "v": "x"}, r"u = 'x' and v = 'x': their divergence is 1 1/s at .* one stream function"),
    (Manufactured, {"u": "-y", "v": "x"}, "are a rigid motion: nothing is strained"),
    (Manufactured, {"u": "log(y)", "v": "0"}, r"u = 'log\(y\)' or a derivative of it is not finite at \(0, 0\)"),
    (Manufactured, {"p": "1/0"}, "p = '1/0' or a derivative of it is not finite"),
]


@pytest.mark.parametrize(("component", "fields", "sentence"), NONSENSE, ids=lambda value: str(value)[:40])
def test_nonsense_is_refused_with_its_field_and_a_sentence(
    component: type[Any], fields: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValidationError, match=sentence) as refusal:
        component(**fields)
    assert any(name in str(refusal.value) for name in fields)


LAGRANGIAN = NodeMotion(nodes="lagrangian")
MISFITS: list[tuple[FlowScene, dict[str, Any], str]] = [
    (EccentricCylinders(), {"motion": LAGRANGIAN}, r'motion\.nodes: .* crowd in its gap; use nodes = "fixed"'),
    (Cavity(), {"physics": ITERATED, "motion": LAGRANGIAN}, r"motion\.nodes: boundary nodes would leave the rectangle"),
    (Cavity(), {}, r"physics\.penalty: nothing flows in or out of a cavity, so its flow needs a penalty"),
    (Cavity(), {"physics": Physics(penalty=0.0)}, r"physics\.penalty: nothing flows in or out of a cavity"),
    (Manufactured(), {"motion": LAGRANGIAN}, r"motion\.nodes: boundary nodes would leave the rectangle"),
]


@pytest.mark.parametrize(("scene", "sections", "sentence"), MISFITS, ids=lambda value: str(value)[:40])
def test_sections_that_do_not_fit_the_scene(scene: FlowScene, sections: dict[str, Any], sentence: str) -> None:
    with pytest.raises(Misfit, match=sentence):
        scene.check(setup(scene, **sections))


def test_a_cavity_of_a_study_has_a_pressure_by_default() -> None:
    document: dict[str, Any] = {
        "question": "?",
        "scene": {"kind": "cavity"},
        "law": {"kind": "norton-hoff"},
        "discretizer": {"kind": "mls"},
        "solver": {"kind": "newton"},
    }

    def physics(**fields: Any) -> Physics:
        return Study.from_dict(document | {"physics": fields}).cases[0].parts.physics

    iterated = Physics(penalty=1000.0, divergence_tolerance=1e-6)
    assert Study.from_dict(document).cases[0].parts.physics == physics() == iterated
    assert physics(density=2.0, convection=True) == iterated.with_(density=2.0, convection=True)
    assert physics(penalty=10.0).penalty == 10.0
    alone = Physics(penalty=0.0)
    with pytest.raises(StudyError, match=r"physics\.penalty = 0\.0: nothing flows in or out of a cavity"):
        Study.from_dict(document | {"physics": alone})

"""What `integrator: auto` of the simulated robot chooses for a problem at the tick rate. Nothing is decided here."""

from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.studies.precision.problem import TICK, Problem


def automatic(problem: Problem) -> tuple[str, int]:
    """The integrator and its substeps per tick."""
    mass, stiffness, damping = problem.body
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=stiffness, damping_n_s_m=damping)
    robot = SimulatedRobot(options, problem.scene(), TICK)
    return robot.integrator, robot.substeps

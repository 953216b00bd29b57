"""The linkages of linkage_problems.py by Exudyn, Drake and MuJoCo, each as its users write them."""

import math
import sys
import time
from collections.abc import Callable

import numpy as np
from linkage_problems import DURATION, GRAVITY, Problem

# A setting -> where the joint ends, seconds of stepping.
Run = Callable[[Problem, dict], tuple[np.ndarray, float]]


class RunError(Exception):
    """A run that did not get to its end."""


def by_exudyn() -> Run:
    """Rigid bodies in the plane with revolute joints, in its module without range checks."""
    sys.exudynFast = True
    import exudyn as exu
    import exudyn.utilities as items

    exu.SetWriteToConsole(False)

    def build(problem: Problem) -> tuple:
        system = exu.SystemContainer()
        mbs = system.AddSystem()

        def marker(body: int, x: float, y: float) -> int:
            return mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[x, y, 0]))

        ground = mbs.AddObject(items.ObjectGround())
        holders = {-1 - k: marker(ground, *place) for k, place in enumerate(problem.fixed)}
        for k, bar in enumerate(problem.bars):
            a, b = problem.place(bar.a), problem.place(bar.b)
            reference = [*(a + b) / 2, math.atan2(*(b - a)[::-1])]
            rates = [*(problem.speed(bar.a) + problem.speed(bar.b)) / 2, problem.turning(k)]
            inertia = bar.mass * bar.length**2 / 12
            node = mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=reference, initialVelocities=rates))
            rigid = items.ObjectRigidBody2D(mass=bar.mass, inertia=inertia, nodeNumber=node)
            body = mbs.AddObject(rigid)
            mass = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=body))
            mbs.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=[0, -GRAVITY, 0]))
            for joint, side in ((bar.a, -1), (bar.b, 1)):
                end = marker(body, side * bar.length / 2, 0)
                if holders.setdefault(joint, end) != end:
                    mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=[holders[joint], end]))
        place = {"outputVariableType": exu.OutputVariableType.Position, "writeToFile": False}
        watch = mbs.AddSensor(items.SensorMarker(markerNumber=holders[problem.watched], **place))
        mbs.Assemble()
        return system, mbs, watch

    def run(problem: Problem, settings: dict) -> tuple[np.ndarray, float]:
        _system, mbs, watch = build(problem)
        chosen = exu.SimulationSettings()
        integration = chosen.timeIntegration
        integration.endTime, integration.numberOfSteps = DURATION, settings["steps"]
        integration.adaptiveStep = False
        integration.newton.useModifiedNewton = False  # which fails earlier at singular positions
        integration.newton.relativeTolerance = integration.newton.absoluteTolerance = settings["newton"]
        chosen.solution.file.write = False
        chosen.solution.sensors.writePeriod = DURATION
        solver = getattr(exu.DynamicSolverType, settings["solver"])
        begin = time.perf_counter()
        try:
            mbs.SolveDynamic(chosen, solverType=solver)
        except exu.SolverError as error:
            raise RunError("its solver stopped") from error
        seconds = time.perf_counter() - begin
        return np.array(mbs.GetSensorValues(watch)[:2]), seconds

    return run


def by_drake() -> Run:
    """A tree of hinges closed by ball constraints, which it has in discrete mode alone, with its solver SAP."""
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
    from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, RotationalInertia, SpatialInertia
    from pydrake.systems.analysis import Simulator

    def run(problem: Problem, settings: dict) -> tuple[np.ndarray, float]:
        plant = MultibodyPlant(time_step=DURATION / settings["steps"])
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector([0, -GRAVITY, 0])
        bodies, hinges = {-1: plant.world_body()}, []

        def spot(number: int, joint: int) -> np.ndarray:
            return np.array([*problem.in_frame(number, joint), 0])

        for k, bar, holder, closing in problem.tree():
            inertia = RotationalInertia(*[bar.mass * bar.length**2 / 12] * 3)
            mass = SpatialInertia.MakeFromCentralInertia(bar.mass, spot(k, bar.b) / 2, inertia)
            bodies[k] = plant.AddRigidBody(f"bar_{k}", mass)
            there = FixedOffsetFrame(f"at_{k}", bodies[holder], RigidTransform(spot(holder, bar.a)))
            here = bodies[k].body_frame()
            hinge = plant.AddJoint(RevoluteJoint(f"hinge_{k}", plant.AddFrame(there), here, [0, 0, 1]))
            hinges.append((hinge, problem.turning(k) - problem.turning(holder)))
            if closing is not None:  # to a bar: to the ground it ends with a segmentation fault
                plant.AddBallConstraint(bodies[closing], spot(closing, bar.b), bodies[k], spot(k, bar.b))
        plant.Finalize()
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        for hinge, rate in hinges:
            hinge.set_angular_rate(context, rate)
        simulator.Initialize()
        begin = time.perf_counter()
        simulator.AdvanceTo(DURATION)
        seconds = time.perf_counter() - begin
        holder = problem.holder()
        end = plant.EvalBodyPoseInWorld(context, bodies[holder]) @ spot(holder, problem.watched)
        return end[:2], seconds

    return run


def by_mujoco() -> Run:
    """A tree of hinges closed by connect equalities, as stiff as it takes them; one call for all steps."""
    import mujoco

    def build(problem: Problem, settings: dict) -> mujoco.MjModel:
        def spot(number: int, joint: int, share: float = 1) -> str:
            x, y = share * problem.in_frame(number, joint)
            return f'"{x:.17g} {y:.17g} 0"'

        def bars_on(holder: int) -> str:
            return "".join(
                f'<body name="bar_{k}" pos={spot(holder, bar.a)}><joint name="hinge_{k}" axis="0 0 1"/>'
                f'<inertial mass="{bar.mass}" pos={spot(k, bar.b, 0.5)} diaginertia="{turns} {turns} {turns}"/>'
                f'<site name="end_{k}" pos={spot(k, bar.b)}/>{bars_on(k)}</body>'
                for k, bar, on, _ in problem.tree()
                if on == holder and (turns := f"{bar.mass * bar.length**2 / 12:.17g}")
            )

        closings = "".join(
            f'<connect body1="bar_{k}" body2="bar_{closing}" anchor={spot(k, bar.b)}/>'
            for k, bar, _, closing in problem.tree()
            if closing is not None
        )
        h = DURATION / settings["steps"]
        return mujoco.MjModel.from_xml_string(f"""<mujoco>
            <option timestep="{h:.17g}" integrator="{settings["integrator"]}" gravity="0 {-GRAVITY} 0"
              tolerance="1e-15"><flag contact="disable" refsafe="disable"/></option>
            <default><equality solref="{settings["stiff"] * h:.17g} 1" solimp="0.9999 0.9999 1"/></default>
            <worldbody>{bars_on(-1)}</worldbody><equality>{closings}</equality></mujoco>""")

    def run(problem: Problem, settings: dict) -> tuple[np.ndarray, float]:
        model = build(problem, settings)
        data = mujoco.MjData(model)
        for k, _, holder, _ in problem.tree():
            data.joint(f"hinge_{k}").qvel[0] = problem.turning(k) - problem.turning(holder)
        begin = time.perf_counter()
        mujoco.mj_step(model, data, nstep=settings["steps"])
        seconds = time.perf_counter() - begin
        if any(warning.number for warning in data.warning):
            raise RunError("unstable")
        mujoco.mj_kinematics(model, data)
        return data.site(f"end_{problem.holder()}").xpos[:2].copy(), seconds

    return run

# The public names of softflagella and their modules: the one list, for type checkers and for `__init__.py`.
from calibration.api import decide as decide
from calibration.findings.next_runs import Decision as Decision
from calibration.own_model.declared import Effect as Effect
from calibration.own_model.declared import Model as Model
from calibration.own_model.declared import Number as Number
from calibration.own_model.model_verdict import ModelVerdict as ModelVerdict
from calibration.robot.robot_verdict import RobotVerdict as RobotVerdict
from calibration.swimmer.synthetic_table import make_table as make_table
from calibration.table.declared import Output as Output
from calibration.verdict.verdict import Verdict as Verdict
from camera.api import tracks as tracks
from common.errors import InputError as InputError
from common.provenance import __version__ as __version__
from common.tables import read_table as read_table
from dataset.api import sweep as sweep
from dataset.data_set import read
from planner.files.boards import write_arduino as write_arduino
from planner.files.boards import write_micropython as write_micropython
from planner.files.plan_files import write_plan as write_plan
from planner.files.saved_plan import load_goal as load_goal
from planner.files.saved_plan import load_plan as load_plan
from planner.files.saved_plan import restore_plan as restore_plan
from planner.goal.trip import Trip as Trip
from planner.goal.trip import to_goal as to_goal
from planner.jobs.hold import Orbit as Orbit
from planner.jobs.hold import hold as hold
from planner.jobs.plan import plan as plan
from planner.jobs.tour import Visits as Visits
from planner.jobs.tour import tour as tour
from planner.page.write_page import write_page as write_page
from planner.paths.obstacles import Circle as Circle
from planner.paths.path import Path2D as Path2D
from planner.paths.path import circle as circle
from planner.paths.path import polygon as polygon
from planner.paths.path_files import Drawing as Drawing
from planner.paths.path_files import read_path as read_path
from planner.planning.plan import Plan as Plan
from planner.planning.request import Camera as Camera
from planner.vehicle.measured import MeasuredVehicle
from sim.api import replay as replay
from sim.api import response as response
from sim.api import sensitivities as sensitivities
from sim.api import steady as steady
from sim.effects import catalogue
from sim.inputs import load_robot as load_robot
from sim.inputs import save_robot as save_robot
from sim.knowledge import CalibrationKnowledge as CalibrationKnowledge
from sim.model.robot import Robot as Robot
from sim.model.schedule import Schedule as Schedule
from sim.model.schedule import load_schedule as load_schedule
from softflagella import plot as plot
from softflagella.closed_loop import calibrate as calibrate
from surrogate.api import inverse as inverse
from surrogate.api import query as query
from surrogate.interface import LookupTable as LookupTable
from surrogate.table_file import load_table as load_table
from surrogate.tabulate import tabulate as tabulate
from surrogate.tensors import torch_query as torch_query
from surrogate.tensors import torch_steady as torch_steady
from surrogate.training.train import train as train
from tracking.swim import Swim as Swim
from tracking.swim import swim as swim
from tracking.tracker import Command as Command
from tracking.tracker import Tracker as Tracker
from tracking.tracks import TrackingError as TrackingError
from tracking.tracks import check as check

effects = catalogue
read_sweep = read
Vehicle = MeasuredVehicle
__all__: list[str]

def __dir__() -> list[str]: ...

"""The Python interface: typed functions, all available by `import scanwright as sw`.

Arguments: angles in degrees, lengths in metres, as in task files. Returned arrays: SI units. Wrong input raises a
`ScanwrightError` whose message is one line for each fault.
"""

from scanwright.api.clouds import make_map as make_map
from scanwright.api.clouds import read_cloud as read_cloud
from scanwright.api.clouds import register as register
from scanwright.api.clouds import write_cloud as write_cloud
from scanwright.api.devices import open_lidar as open_lidar
from scanwright.api.devices import open_servo as open_servo
from scanwright.api.devices import scan as scan
from scanwright.api.devices import set_up_servo as set_up_servo
from scanwright.api.devices import simulate as simulate
from scanwright.api.parts import build as build
from scanwright.api.parts import check as check
from scanwright.api.parts import make_parts as make_parts
from scanwright.api.recordings import assemble as assemble
from scanwright.api.recordings import calibrate as calibrate
from scanwright.api.recordings import import_bag as import_bag
from scanwright.api.recordings import open_recording as open_recording
from scanwright.api.tasks import compare as compare
from scanwright.api.tasks import draw_density as draw_density
from scanwright.api.tasks import evaluate as evaluate
from scanwright.api.tasks import optimise as optimise
from scanwright.design.angles import load_angles as load_angles
from scanwright.design.task.task import load_task as load_task

"""Identity and clock of emulated Hokuyos, from captures of real sensors unless an entry states otherwise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from scanwright.firmware_io.lidar.device_clock import STAMP_WRAP_MS
from scanwright.firmware_io.lidar.scip.parameters import Parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Properties of a model."""

    parameters: Parameters  # its PP reply
    product: str  # PROD of VV
    firmware: str  # FIRM of VV
    serial_number: str  # SERI of VV
    speed: str  # SCSP of II
    mode: str = "CLASSIC"  # MESM of II
    line: str = "USB Full Speed"  # SBPS of II
    speed_request: str = "04"  # status of a CR request without effect
    no_return: int  # error code of a beam without return
    too_near: int  # error code of a range below the smallest one
    intensity: bool = True  # whether it measures intensities
    echoes: bool = False  # whether it sends all echoes of a beam (HD, HE, ND, NE)


# Parameters: model, range [mm], steps per turn, first, last and front step, rpm
_URG_04LX = Identity(
    parameters=Parameters("URG-04LX", 20, 5600, 1024, 44, 725, 384, 600),
    product="SOKUIKI Sensor URG-04LX",
    firmware="3.1.04(02/Aug./2007)",
    serial_number="H0706400",
    speed="Initial(600[rpm])<-Default setting by user",
    line="19200[bps]<-Default setting by user",
    speed_request="03",
    no_return=0,
    too_near=6,
    intensity=False,
)
_UTM_30LX = Identity(
    parameters=Parameters("UTM-30LX", 23, 60000, 1440, 0, 1080, 540, 2400),
    product="SOKUIKI Sensor TOP-URG UTM-30LX",
    firmware="P.1.05(17/Apr./2009)",
    serial_number="00903971",
    speed="Initial(2400[rpm])<-Default setting by user",
    no_return=1,
    too_near=2,
)
_UXM_30LX_E = Identity(
    parameters=Parameters("UXM-30LX-E", 100, 100000, 1440, 0, 760, 380, 1200),
    product="SOKUIKI Sensor Tough-URG UXM-30LX-E",
    firmware="0.3.01(11/Mar./2010)",
    serial_number="H0909106",
    speed="Initial(1200[rpm])",
    mode="STANDARD(max:100000[mm])",
    no_return=0,
    too_near=0,
)
_UST_10LX = Identity(  # no capture: product, serial number and mode are made up
    parameters=Parameters("UST-10LX", 20, 30000, 1440, 0, 1080, 540, 2400),
    product="SOKUIKI Sensor UST-10LX",
    firmware="4.0.2-A",
    serial_number="H1300001",
    speed="2400",
    mode="Measuring by Normal Mode",
    line="Ethernet 100 [Mbps]",
    no_return=65533,
    too_near=65533,
)
# No captures of the others: parameters from a user (hokuyoaist, issue 1) and a simulator (urg_sim); the rest is made up
# after the sensors above.
_UG01 = replace(
    _URG_04LX,
    parameters=replace(_URG_04LX.parameters, model="URG-04LX-UG01"),
    product="SOKUIKI Sensor URG-04LX-UG01(Simple-URG)",
    firmware="3.3.01",
    serial_number="H1000001",
    line="USB Full Speed",
)
_UTM_30LX_EW = replace(
    _UTM_30LX,
    parameters=replace(_UTM_30LX.parameters, model="UTM-30LX-EW"),
    product="SOKUIKI Sensor UTM-30LX-EW",
    firmware="1.1.0",
    serial_number="H1200001",
    speed="2400",
    line="Ethernet 100 [Mbps]",
    echoes=True,
)
_UST_20LX = replace(
    _UST_10LX,
    parameters=replace(_UST_10LX.parameters, model="UST-20LX", range_max_mm=60000),
    product="SOKUIKI Sensor UST-20LX",
    serial_number="H1300002",
)
IDENTITIES = {
    known.parameters.model: known
    for known in (_URG_04LX, _UTM_30LX, _UXM_30LX_E, _UST_10LX, _UG01, _UTM_30LX_EW, _UST_20LX)
}


@dataclass(frozen=True, slots=True)
class Quartz:
    """A sensor's clock."""

    began_ns: int
    clock_ms: int  # at `began_ns`
    rate_error: float  # relative, positive if fast

    def ms(self, time_ns: int) -> int:
        """Return the sensor time, 24 bit."""
        shown_ms = self.clock_ms + math.floor((time_ns - self.began_ns) * (1 + self.rate_error) / 1e6)
        return shown_ms % STAMP_WRAP_MS

"""Which RPLIDARs there are: what each says of itself, its scan modes, its motor. As units on users' desks answer."""

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class ScanMode:
    """An answer type, the points and bytes of one packet, the time of a sample, and what the unit calls it."""

    answer: int
    points: int
    size: int
    sample_s: float
    name: str = "Standard"
    reach_m: float = 12.0


STANDARD_MODE = ScanMode(0x81, 1, 5, 500e-6)
EXPRESS_MODE = ScanMode(0x82, 32, 84, 250e-6, "Express")
ULTRA_MODE = ScanMode(0x84, 96, 132, 127e-6, "Sensitivity")
DENSE_MODE = ScanMode(0x85, 40, 84, 62.5e-6, "DenseBoost")
ULTRA_DENSE_MODE = ScanMode(0x86, 64, 170, 100e-6, "DenseBoost", 16.0)


@dataclass(frozen=True, slots=True)
class Model:
    """What a unit is and can. `modes` is its table of scan modes; firmware before 1.24 does not tell it.

    The head turns at `hz_at_660` with the motor's duty at 660 of 1023, and is steady `spin_up_s` after it was told.
    `has_pwm`: the motor hears what it is told, else it turns at that speed whenever the unit has power.
    `triangulates`: points lie behind where the head looks, by an angle that depends on the distance, and edges give
    none; `zeros` is the share of other samples that measure nothing.
    `pwm_ends_scan`: nobody wrote down whether the motor may be told during a scan.
    """

    firmware: tuple[int, int] = (1, 29)
    modes: tuple[ScanMode, ...] = (STANDARD_MODE, EXPRESS_MODE)
    baud: int = 115200
    number: int = 0x28
    hardware: int = 5
    hz_at_660: float = 10.0
    spin_up_s: float = 0.0
    reset_s: float = 0.0
    has_pwm: bool = True
    pwm_ends_scan: bool = False
    triangulates: bool = True
    zeros: float = 0.0
    warning: int = 0  # code of a health warning
    broken: bool = False  # reports an error, even after a reset

    @property
    def typical(self) -> int:
        """Number of the mode that the unit recommends: the last of the fastest."""
        return min(range(len(self.modes)), key=lambda number: (self.modes[number].sample_s, -number))


def _modes(standard_us: float, fast_us: float, stable_us: float, reach_m: float) -> tuple[ScanMode, ...]:
    """Five modes, as firmware 1.24 and newer names them."""
    rows = (
        (STANDARD_MODE, standard_us, "Standard"),
        (EXPRESS_MODE, 2 * fast_us, "Express"),
        (ULTRA_MODE, fast_us, "Boost"),
        (ULTRA_MODE, fast_us, "Sensitivity"),
        (ULTRA_MODE, stable_us, "Stability"),
    )
    return tuple(replace(mode, sample_s=us * 1e-6, name=name, reach_m=reach_m) for mode, us, name in rows)


_REAL = Model(hz_at_660=10.6, spin_up_s=1.5, reset_s=0.8, zeros=0.02)

MODELS = {
    "a2m8-1.20": replace(
        _REAL,
        firmware=(1, 20),
        modes=(replace(STANDARD_MODE, sample_s=508e-6), replace(EXPRESS_MODE, sample_s=254e-6)),
    ),
    "a2m8-1.29": replace(_REAL, modes=_modes(508, 127, 201, 12.0)),
    "a2m7": replace(_REAL, number=0x27, baud=256000, modes=_modes(250, 63, 100, 16.0)),
    "a2m12": replace(_REAL, firmware=(1, 32), number=0x2C, baud=256000, modes=_modes(250, 63, 100, 12.0)),
    "a1": replace(_REAL, number=0x18, hardware=7, has_pwm=False, hz_at_660=7.3, modes=_modes(508, 127, 201, 12.0)),
    "a3": replace(_REAL, number=0x31, hardware=6, baud=256000, modes=_modes(250, 63, 100, 25.0)),
}
"""By the names that `lira twin --lidar` takes. The last of a name is the firmware, where it matters."""

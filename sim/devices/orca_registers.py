"""The Orca's register map (docs/devices.md 1.3): addresses, what can be written, what is there after power-up.

Not documented, and chosen here: which registers refuse to be written (all that are status), the power-up values
of everything but baudrate (19200), interframe delay (2000 µs) and address (1), the units of POS_MAX_VEL,
POS_MAX_ACCEL and POS_MAX_DECEL (taken as mm/s and mm/s²), and that gaps inside the map read 0.
"""

from __future__ import annotations

CTRL_REG_0, CTRL_REG_1, CTRL_REG_2, CTRL_REG_3, CTRL_REG_4 = 0, 1, 2, 3, 4
KIN_SW_TRIGGER = 9
FORCE_CMD = 28
POS_CMD = 30
PC_PGAIN, PC_IGAIN, PC_DVGAIN, PC_DEGAIN, PC_FSATU = 133, 134, 135, 136, 137
USER_MAX_TEMP = 139
USER_MAX_FORCE = 140
USER_MAX_POWER = 142
SAFETY_DGAIN = 143
POS_SIGN = 152
POS_MAX_VEL, POS_MAX_ACCEL, POS_MAX_DECEL = 153, 154, 155
USER_COMMS_TIMEOUT = 163
USR_MB_BAUD = 164
USR_MB_DELAY = 168
USR_MB_ADDR = 169
ZERO_MODE, AUTO_ZERO_FORCE_N, AUTO_ZERO_EXIT_MODE = 171, 172, 173
AUTO_ZERO_SPEED_MMPS = 177
MB_FREQ = 273
MODE_OF_OPERATION = 317
KINEMATIC_STATUS, KIN_COMPLETE_COUNT, MOTOR_STATUS = 319, 320, 321
POS_CURSOR = 322
BOARD_TEMP, VDD_FINAL = 336, 338
SHAFT_POS_UM, SHAFT_SPEED_MMPS = 342, 344
FORCE, POWER, AVG_POWER, COIL_TEMP = 348, 350, 355, 356
SERIAL_NUMBER = 406
MAJOR_VERSION, RELEASE_STATE, REVISION_NUMBER = 408, 409, 410
STATOR_CONFIG = 418
ERROR_0, ERROR_1 = 432, 433
MB_CNT = 464
MB_BAUD, MB_IF_DELAY, MB_ADDRESS = 482, 484, 485
KIN_MOTION_0 = 780
KIN_HOME_ID = 972
MAP_SIZE = 973

WRITABLE = frozenset(
    [*range(0, 5), KIN_SW_TRIGGER, *range(28, 32), *range(129, 132), *range(133, 144), 147, 148]
    + [*range(150, 156), *range(162, 170), *range(171, 185), *range(641, 676), *range(780, MAP_SIZE)]
)

SLEEP, FORCE_MODE, POSITION, HAPTIC, KINEMATIC, AUTO_ZERO = 1, 2, 3, 4, 5, 55

CONFIG_INVALID = 1 << 0
FORCE_CLIPPING = 1 << 5
MAX_FORCE = 1 << 7
COMMS_TIMEOUT = 1 << 11
AUTO_ZERO_FAILED = 1 << 13

BOARD_TEMPERATURE_C = 31
VOLTAGE_mV = 24000


def power_up_values(baudrate: int, delay_us: int, address: int, max_force_mN: int) -> list[int]:
    """The map after power-up of a motor that was set up to talk at the given baudrate, delay and address."""
    registers = [0] * MAP_SIZE
    for place, value in (
        (FORCE_CMD, 0),
        (PC_FSATU, max_force_mN),
        (USER_MAX_FORCE, max_force_mN),
        (USR_MB_BAUD, 0 if baudrate == 19200 else baudrate),
        (SERIAL_NUMBER, 600_141),
        (MB_BAUD, baudrate),
    ):
        put_wide(registers, place, value)
    registers[PC_PGAIN : PC_DEGAIN + 1] = [200, 0, 500, 0]
    registers[USER_MAX_TEMP] = 80
    registers[USER_MAX_POWER] = 500
    registers[SAFETY_DGAIN] = 50
    registers[USR_MB_DELAY] = delay_us
    registers[USR_MB_ADDR] = address
    registers[ZERO_MODE] = 1
    registers[AUTO_ZERO_FORCE_N] = 30
    registers[AUTO_ZERO_EXIT_MODE] = SLEEP
    registers[AUTO_ZERO_SPEED_MMPS] = 50
    registers[BOARD_TEMP] = registers[COIL_TEMP] = BOARD_TEMPERATURE_C
    registers[VDD_FINAL] = VOLTAGE_mV
    registers[MAJOR_VERSION], registers[RELEASE_STATE], registers[REVISION_NUMBER] = 7, 2, 2
    for motion in range(32):
        registers[KIN_MOTION_0 + 6 * motion + 2] = 1000  # ms
    registers[MB_IF_DELAY] = delay_us
    registers[MB_ADDRESS] = address
    return registers


def put_wide(registers: list[int], address: int, value: int) -> None:
    """Store a 32-bit value, low word at the lower address."""
    registers[address] = value & 0xFFFF
    registers[address + 1] = (value >> 16) & 0xFFFF


def wide(registers: list[int], address: int) -> int:
    """A signed 32-bit value, low word at the lower address."""
    value = registers[address] | registers[address + 1] << 16
    return value - (1 << 32) if value & 0x8000_0000 else value

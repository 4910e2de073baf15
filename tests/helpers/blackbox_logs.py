"""Made flights as blackbox logs of INAV and Betaflight: a writer of the format, apart from the package's reader.

Encoders after betaflight's src/main/blackbox/blackbox_encoding.c, predictors after its blackbox.c.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

GRAVITY, ACC_1G = 9.80665, 2048
SIGNED, UNSIGNED, TAG8_8SVB, TAG2_3S32, TAG8_4S16, NULL, TAG2_3SVARIABLE = 0, 1, 6, 7, 8, 9, 10
ZERO, PREVIOUS, STRAIGHT_LINE, AVERAGE_2, INC, HOME, LAST_TIME = 0, 1, 2, 3, 6, 7, 10


def uvb(value: int) -> bytes:
    out = bytearray()
    value &= 0xFFFFFFFF
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


def svb(value: int) -> bytes:
    return uvb((value << 1) ^ (value >> 31))


def tag8_8svb(values: list[int]) -> bytes:
    if len(values) == 1:
        return svb(values[0])
    head = sum(1 << k for k, value in enumerate(values) if value)
    return bytes([head]) + b"".join(svb(value) for value in values if value)


def sized(values: list[int]) -> tuple[int, bytes]:
    """Two bits a value that say its width, and the bytes."""
    selector, out = 0, b""
    for k, value in enumerate(values):
        width = next(w for w in (1, 2, 3, 4) if -(1 << (8 * w - 1)) <= value < 1 << (8 * w - 1))
        selector |= (width - 1) << (2 * k)
        out += (value & ((1 << (8 * width)) - 1)).to_bytes(width, "little")
    return selector, out


def tag2_3s32(v: list[int]) -> bytes:
    if all(-2 <= each < 2 for each in v):
        return bytes([(v[0] & 3) << 4 | (v[1] & 3) << 2 | v[2] & 3])
    if all(-8 <= each < 8 for each in v):
        return bytes([1 << 6 | v[0] & 15, (v[1] & 15) << 4 | v[2] & 15])
    if all(-32 <= each < 32 for each in v):
        return bytes([2 << 6 | v[0] & 63, v[1] & 255, v[2] & 255])
    selector, out = sized(v)
    return bytes([3 << 6 | selector]) + out


def tag2_3svariable(v: list[int]) -> bytes:
    if all(-2 <= each < 2 for each in v):
        return bytes([(v[0] & 3) << 4 | (v[1] & 3) << 2 | v[2] & 3])
    if -16 <= v[0] < 16 and -16 <= v[1] < 16 and -8 <= v[2] < 8:
        return bytes([1 << 6 | (v[0] & 31) << 1 | (v[1] & 31) >> 4, (v[1] & 15) << 4 | v[2] & 15])
    if -128 <= v[0] < 128 and -64 <= v[1] < 64 and -64 <= v[2] < 64:
        return bytes([2 << 6 | (v[0] & 255) >> 2, (v[0] & 3) << 6 | (v[1] & 127) >> 1, (v[1] & 1) << 7 | v[2] & 127])
    selector, out = sized(v)
    return bytes([3 << 6 | selector]) + out


def tag8_4s16(v: list[int]) -> bytes:
    sizes = [0 if x == 0 else 1 if -8 <= x < 8 else 2 if -128 <= x < 128 else 4 for x in v]
    nibbles = [x >> 4 * (size - 1 - k) & 15 for x, size in zip(v, sizes, strict=True) for k in range(size)]
    nibbles += [0] * (len(nibbles) % 2)
    codes = {0: 0, 1: 1, 2: 2, 4: 3}
    head = sum(codes[size] << 2 * k for k, size in enumerate(sizes))
    return bytes([head]) + bytes(a << 4 | b for a, b in zip(nibbles[::2], nibbles[1::2], strict=True))


def packed(encodings: list[int], values: list[int]) -> bytes:
    out, k = b"", 0
    while k < len(values):
        code = encodings[k]
        same = next((j for j in range(k, len(values)) if encodings[j] != code), len(values)) - k
        count = {TAG8_8SVB: min(same, 8), TAG2_3S32: 3, TAG2_3SVARIABLE: 3, TAG8_4S16: 4}.get(code, 1)
        part = values[k : k + count]
        if code == NULL:
            assert part == [0]
        else:
            write = {SIGNED: lambda v: svb(v[0]), UNSIGNED: lambda v: uvb(v[0]), TAG8_8SVB: tag8_8svb,
                     TAG2_3S32: tag2_3s32, TAG8_4S16: tag8_4s16, TAG2_3SVARIABLE: tag2_3svariable}[code]  # fmt: skip
            out += write(part)
        k += count
    return out


@dataclass
class BlackboxLog:
    """Main fields as (name, I encoding, P predictor, P encoding); rows of whole numbers; GPS rows by time."""

    settings: dict[str, str]
    fields: list[tuple[str, int, int, int]]
    rows: list[list[int]] = field(default_factory=list)
    gps_fields: list[tuple[str, int, int]] = field(default_factory=list)
    gps: list[tuple[int, list[int]]] = field(default_factory=list)  # time [us], values without it
    home: tuple[int, int] = (0, 0)

    def content(self, every: int = 32) -> bytes:
        lines = ["Product:Blackbox flight data recorder by Nicholas Sherlock", "Data version:2", f"I interval:{every}"]
        lines += [f"Field I {what}:{','.join(map(str, codes))}" for what, codes in (
            ("name", [f[0] for f in self.fields]), ("signed", [1] * len(self.fields)),
            ("predictor", [ZERO] * len(self.fields)), ("encoding", [f[1] for f in self.fields]))]  # fmt: skip
        lines += [f"Field P predictor:{','.join(str(f[2]) for f in self.fields)}",
                  f"Field P encoding:{','.join(str(f[3]) for f in self.fields)}"]  # fmt: skip
        if self.gps_fields:
            lines += [f"Field G {what}:{','.join(str(f[k]) for f in self.gps_fields)}"
                      for k, what in enumerate(("name", "predictor", "encoding"))]  # fmt: skip
            lines += ["Field H name:GPS_home[0],GPS_home[1]", "Field H predictor:0,0", "Field H encoding:0,0"]
        lines += ["Field S name:flightModeFlags,stateFlags,failsafePhase,rxSignalReceived,rxFlightChannelsValid",
                  "Field S predictor:0,0,0,0,0", "Field S encoding:1,1,7,7,7"]  # fmt: skip
        lines += [f"{name}:{value}" for name, value in self.settings.items()]
        out = ["".join(f"H {line}\n" for line in lines).encode()]
        out.append(b"S" + uvb(3) + uvb(1) + tag2_3s32([0, 1, 1]))
        out.append(b"E\x00" + uvb(1234))
        time = [f[0] for f in self.fields].index("time")
        fixes = list(self.gps)
        if fixes:
            out.append(b"H" + svb(self.home[0]) + svb(self.home[1]))
        last = before = None
        for k, row in enumerate(self.rows):
            if k % every == 0 or last is None:
                out.append(b"I" + packed([f[1] for f in self.fields], row))
                before = last = row
            else:
                left = [self._left(f[2], value, j, last, before) for j, (f, value) in
                        enumerate(zip(self.fields, row, strict=True))]  # fmt: skip
                out.append(b"P" + packed([f[3] for f in self.fields], left))
                before, last = last, row
            while fixes and fixes[0][0] <= row[time]:
                at, values = fixes.pop(0)
                out.append(b"G" + self._fix(max(at, 0) - row[time], values))
        out.append(b"E\xffEnd of log\0")
        return b"".join(out)

    @staticmethod
    def _left(predictor: int, value: int, j: int, last: list[int], before: list[int]) -> int:
        both = last[j] + before[j]
        so = {ZERO: 0, PREVIOUS: last[j], STRAIGHT_LINE: 2 * last[j] - before[j], INC: last[j] + 1,
              AVERAGE_2: int(both / 2)}[predictor]  # fmt: skip
        return value - so

    def _fix(self, later_us: int, values: list[int]) -> bytes:
        home, numbers = list(self.home), [later_us, *values]
        pairs = zip(self.gps_fields, numbers, strict=True)
        left = [number - home.pop(0) if each[1] == HOME else number for each, number in pairs]
        return packed([f[2] for f in self.gps_fields], left)


def wanted(inav: bool) -> list[tuple[str, int, int, int]]:
    """Main fields as the firmwares log them, with every encoding that they use somewhere."""
    fields = [("loopIteration", UNSIGNED, INC, NULL), ("time", UNSIGNED, STRAIGHT_LINE, SIGNED)]
    fields += [(f"axisI[{k}]", SIGNED, PREVIOUS, TAG2_3S32) for k in range(3)]
    fields += [(f"rcCommand[{k}]", SIGNED, PREVIOUS, TAG8_4S16) for k in range(4)]
    fields += [("vbat", UNSIGNED, PREVIOUS, TAG8_8SVB), ("BaroAlt" if inav else "baroAlt", SIGNED, PREVIOUS, TAG8_8SVB),
               ("surfaceRaw", SIGNED, PREVIOUS, TAG8_8SVB)]  # fmt: skip
    fields += [(f"gyroADC[{k}]", SIGNED, AVERAGE_2, SIGNED) for k in range(3)]
    fields += [(f"accSmooth[{k}]", SIGNED, AVERAGE_2, TAG2_3SVARIABLE) for k in range(3)]
    if inav:
        fields += [(f"attitude[{k}]", SIGNED, AVERAGE_2, SIGNED) for k in range(3)]
        fields += [(f"debug[{k}]", SIGNED, AVERAGE_2, SIGNED) for k in range(4)]
        fields += [(f"{name}[{k}]", SIGNED, PREVIOUS, SIGNED) for name in ("navPos", "navVel") for k in range(3)]
    else:
        fields += [(f"imuQuaternion[{k}]", SIGNED, AVERAGE_2, SIGNED) for k in range(3)]
    return fields


def held(at_s: np.ndarray, t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The last value at each instant, the first before it."""
    return values[np.clip(np.searchsorted(t_s, at_s + 1e-9, side="right") - 1, 0, len(t_s) - 1)]


def quantised(tables: dict[str, dict[str, np.ndarray]], inav: bool, high_resolution: bool = True):
    """The flight as such a log can say it: whole units, and no flow with Betaflight."""
    kept = {name: {column: np.array(values) for column, values in tables[name].items()}
            for name in ("attitude", "imu", "range", "baro", "gps", *(("flow",) if inav else ()))}  # fmt: skip
    step = np.radians(0.1 if high_resolution and not inav else 1.0)
    for axis in "xyz":
        kept["imu"][f"gyro_{axis}_rad_s"] = step * np.rint(kept["imu"][f"gyro_{axis}_rad_s"] / step)
        unit = GRAVITY / ACC_1G
        kept["imu"][f"accel_{axis}_m_s2"] = unit * np.rint(kept["imu"][f"accel_{axis}_m_s2"] / unit)
    if inav:
        for name in ("roll_rad", "pitch_rad", "yaw_rad"):
            kept["attitude"][name] = np.radians(0.1 * np.rint(10 * np.degrees(kept["attitude"][name])))
        for name in ("flow_x", "flow_y", "gyro_x", "gyro_y"):
            column = f"{name}_rad_s"
            kept["flow"][column] = np.radians(np.rint(np.degrees(kept["flow"][column])))
    kept["range"]["range_m"] = 0.01 * np.rint(100 * kept["range"]["range_m"])
    kept["baro"]["alt_m"] = 0.01 * np.rint(100 * kept["baro"]["alt_m"])
    gps = kept["gps"]
    for name in ("lat_deg", "lon_deg"):
        gps[name] = 1e-7 * np.rint(1e7 * gps[name])
    unit = 1.0 if inav else 0.1
    gps["alt_m"] = unit * np.rint(gps["alt_m"] / unit)
    if inav:
        for axis in "ned":
            gps[f"vel_{axis}_m_s"] = 0.01 * np.rint(100 * gps[f"vel_{axis}_m_s"])
    else:
        speed = 0.01 * np.rint(100 * np.hypot(gps["vel_n_m_s"], gps["vel_e_m_s"]))
        course = np.radians(
            0.1 * np.rint(10 * np.degrees(np.arctan2(gps["vel_e_m_s"], gps["vel_n_m_s"]) % (2 * np.pi)))
        )
        gps["vel_n_m_s"], gps["vel_e_m_s"] = speed * np.cos(course), speed * np.sin(course)
        gps["vel_d_m_s"] = np.full(len(speed), np.nan)
    return kept


def blackbox_log(tables: dict[str, dict[str, np.ndarray]], inav: bool, boot_s: float = 20.0) -> BlackboxLog:
    """The tables of `quantised` in the firmware's fields: a row for each inertial reading."""
    imu, attitude, gps = tables["imu"], tables["attitude"], tables["gps"]
    t = imu["t_s"]
    degrees = 1.0 if inav else 0.1
    sign = (1.0, -1.0, -1.0)
    columns: dict[str, np.ndarray] = {"loopIteration": np.arange(len(t)), "time": np.rint(1e6 * (t + boot_s))}
    columns |= {f"axisI[{k}]": np.rint(60 * np.sin(0.1 * (k + 1) * np.arange(len(t)))) for k in range(3)}
    columns |= {f"rcCommand[{k}]": np.rint(400 * np.sin(0.07 * (k + 1) * np.arange(len(t)))) for k in range(4)}
    columns |= {"vbat": 1680 - np.arange(len(t)) // 9}
    columns["BaroAlt" if inav else "baroAlt"] = np.rint(100 * held(t, tables["baro"]["t_s"], tables["baro"]["alt_m"]))
    columns["surfaceRaw"] = np.rint(100 * held(t, tables["range"]["t_s"], tables["range"]["range_m"]))
    for k, axis in enumerate("xyz"):
        columns[f"gyroADC[{k}]"] = np.rint(sign[k] * np.degrees(imu[f"gyro_{axis}_rad_s"]) / degrees)
        columns[f"accSmooth[{k}]"] = np.rint(sign[k] * imu[f"accel_{axis}_m_s2"] / GRAVITY * ACC_1G)
    angles = [held(t, attitude["t_s"], attitude[f"{name}_rad"]) for name in ("roll", "pitch", "yaw")]
    if inav:
        yaw = np.rint(10 * np.degrees(angles[2])) % 3600
        columns |= {"attitude[0]": np.rint(10 * np.degrees(angles[0])),
                    "attitude[1]": np.rint(-10 * np.degrees(angles[1])), "attitude[2]": yaw}  # fmt: skip
        flow = tables["flow"]
        for k, (name, turned) in enumerate((("flow_x", 1), ("flow_y", -1), ("gyro_x", 1), ("gyro_y", -1))):
            columns[f"debug[{k}]"] = np.rint(turned * np.degrees(held(t, flow["t_s"], flow[f"{name}_rad_s"])))
        columns |= {f"nav{what}[{k}]": 100 * np.full(len(t), k + 1) for what in ("Pos", "Vel") for k in range(3)}
        columns["navPos[0]"] = np.arange(len(t))
    else:
        r, p, y = angles[0], -angles[1], -angles[2]  # FLU in north-west-up
        cr, sr, cp, sp, cy, sy = (
            np.cos(r / 2),
            np.sin(r / 2),
            np.cos(p / 2),
            np.sin(p / 2),
            np.cos(y / 2),
            np.sin(y / 2),
        )
        w = cr * cp * cy + sr * sp * sy
        xyz = np.array([sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy])
        xyz *= np.where(w < 0, -1.0, 1.0)
        columns |= {f"imuQuaternion[{k}]": np.rint(32767 * xyz[k]) for k in range(3)}
    settings = {
        "Firmware type": "INAV" if inav else "Betaflight", "gyro_scale": "0x3f800000", "acc_1G": str(ACC_1G),
        "Firmware revision": "INAV 7.1.0 (abcdef01) MATEKF405" if inav else "Betaflight 4.5.1 (77d01ba3b) STM32F7X2",
        "debug_mode": "2" if inav else "0", "P interval": "1/1", "minthrottle": "1070", "vbatref": "1680",
        **({} if inav else {"blackbox_high_resolution": "1", "motorOutput": "48,2047"}),
    }  # fmt: skip
    log = BlackboxLog(settings, wanted(inav))
    table = np.column_stack([columns[f[0]] for f in log.fields]).astype(np.int64)
    log.rows = table.tolist()
    coordinates = np.rint(1e7 * np.column_stack([gps["lat_deg"], gps["lon_deg"]])).astype(np.int64)
    log.home = tuple(coordinates[0].tolist())
    log.gps_fields = [("time", LAST_TIME, UNSIGNED), *([("GPS_fixType", ZERO, UNSIGNED)] if inav else []),
                      ("GPS_numSat", ZERO, UNSIGNED), ("GPS_coord[0]", HOME, SIGNED), ("GPS_coord[1]", HOME, SIGNED),
                      ("GPS_altitude", ZERO, SIGNED if inav else UNSIGNED), ("GPS_speed", ZERO, UNSIGNED),
                      ("GPS_ground_course", ZERO, UNSIGNED)]  # fmt: skip
    log.gps_fields += [(f"GPS_velned[{k}]", ZERO, SIGNED) for k in range(3)] if inav else []
    speed = np.rint(100 * np.hypot(gps["vel_n_m_s"], gps["vel_e_m_s"]))
    course = np.rint(10 * np.degrees(np.arctan2(gps["vel_e_m_s"], gps["vel_n_m_s"]) % (2 * np.pi)))
    for k, at in enumerate(gps["t_s"]):
        values = [*([2] if inav else []), 12, *coordinates[k].tolist(),
                  round(gps["alt_m"][k] * (1 if inav else 10)), int(speed[k]), int(course[k])]  # fmt: skip
        values += [round(100 * gps[f"vel_{axis}_m_s"][k]) for axis in "ned"] if inav else []
        log.gps.append((round(1e6 * (at + boot_s)), values))
    return log

"""The sentences of the findings about rows."""

from __future__ import annotations

from ...framework.core.findings import Finding, Sentence, Values, in_words


def _pull_units(values: Values) -> str:
    units = [{"load": "divided by the load"}.get(unit, f"in {unit}") for unit in values["units"]]
    return (
        f"drawbar_pull_N is {values['pull_N']:.2g} N (upper tenth) under loads of {values['load_N']:.3g} N (median). "
        f"It would be usual if it were {' or '.join(units)}: check its unit"
    )


def _speed_units(values: Values) -> str:
    likely = " or ".join(f"{each['channel']} in {each['unit']}" for each in values["likely"])
    return (
        f"the two speeds give slips of about {values['slip']:.2g} throughout, and usual ones if {likely}: check units"
    )


def _load_unit(values: Values) -> str:
    what = "torque over radius" if values["channel"] == "torque_Nm" else "the pull"
    return (
        f"{what} is {values['ratio']:.2g} times the load (upper tenth of the driven rows), more than sand bears. "
        f"It would be {values['ratio_if_kg']:.2g} times, as usual, if load_N were in kg: check its unit"
    )


def _slip(values: Values) -> str:
    side = "above" if values["difference"] > 0.0 else "below"
    agreeing = values["agreeing_radius_m"]
    radius = "" if agreeing is None else f"; {agreeing:.3g} m would make them agree"
    return (
        f"the recorded slip is {abs(values['difference']):.2g} {side} what the two speeds give with a radius of "
        f"{values['radius_m']:g} m (median of {values['n']} rows){radius}. Check radius and definition of slip; the "
        "recorded slip is used"
    )


def _angle(values: Values) -> str:
    if values["unit"] is not None:
        why = f"{values['channel']} is probably in {values['unit']}"
    elif values["speed"] == "wheel_speed_rad_s":
        why = "check its unit, that of the speed, and whether a gear lies between"
    else:
        why = "check its unit, the radius and the slip"
    return (
        f"wheel_angle_rad changes {values['factor']:.3g} times as fast as {values['speed']} says (median of "
        f"{values['n']} pairs of rows): {why}"
    )


def _duplicates(values: Values) -> str:
    rows = "; ".join([*values["rows"], *([f"{values['more']} more"] if values["more"] else [])])
    one = values["n"] == 1
    what = "row equals an earlier one" if one else "rows equal earlier ones"
    return f"{values['n']} {what} in every channel and {'is' if one else 'are'} left out as duplicates: {rows}"


def _stops(values: Values) -> str:
    of = "a run" if values["runs"] == 1 else f"{values['runs']} runs"
    return f"{values['n']} rows of {of} are left out, in which the wheel is started or stopped"


def _settling(values: Values) -> str:
    what, where = ("steps", "goes from one state to the next") if values["steps"] else ("runs", "starts")
    return (
        f"the first {values['seconds']:.3g} s of {values['runs']} {what} are left out, where the wheel {where}. Load, "
        f"slip and speed are steady there, and {', '.join(values['channels'])} not yet"
    )


def _without_time(values: Values) -> str:
    runs = "1 run" if values["runs"] == 1 else f"{values['runs']} runs"
    return f"{values['n']} rows of {runs} have no time_s: each row is taken as a steady trial"


def _load_computed(values: Values) -> str:
    moved = {"pitch_rad": "slope", "roll_rad": "roll", "travel_speed_m_s": "acceleration", "yaw_rad": "bends"}
    by = ", ".join(moved[name] for name in values["transfer"])
    return (
        f"load_N was not sensed. It is computed from the vehicle's weight{f' and from {by}' if by else ''}: "
        f"{values['load_N']:.3g} N on average, with a standard deviation of {values['sd_N']:.2g} N. c and tan phi have "
        "the relative error of the load, too"
    )


def _torque_computed(values: Values) -> str:
    losses = f" less {values['friction_Nm']:.3g} N m of friction" if values["friction_Nm"] else ""
    doubt = ". The motor states no losses, and what is lost counts as torque at the wheel" if values["lossless"] else ""
    return (
        f"torque_Nm was not sensed. It is computed from the motors' current, {values['Nm_A']:.3g} N m/A{losses}: "
        f"{values['torque_Nm']:.3g} N m on average{doubt}. c and tan phi have the relative error of the torque, too"
    )


def _pull_computed(values: Values) -> str:
    towed = ", ".join(values["towed"])
    resists = f", with the resistance of {towed}," if towed else ""
    taken = ""
    if towed:
        taken = (
            f" The resistance is taken as {values['resistance']:g} of the load there, with a standard deviation of "
            f"{values['resistance_sd']:g}."
        )
    return (
        f"drawbar_pull_N was not sensed. It is computed: the force on the slope and that of acceleration{resists} "
        f"are shared among the driven wheels by their loads, within {values['sd_N']:.2g} N. This holds for a vehicle "
        f"that tows nothing.{taken} A sensor of sinkage would narrow stiffness, n and cohesion most"
    )


def _driven_not_known(values: Values) -> str:
    wheels = values["wheels"]
    are = f"wheel {wheels[0]} is" if len(wheels) == 1 else f"wheels {', '.join(wheels)} are"
    return (
        f"no drawbar pull is computed: {are} in the vehicle file, but not in the recording, and may be driven or not. "
        "Write driven = false there for a wheel without a motor, driven = true for one whose rows are missing"
    )


SENTENCES: dict[str, Sentence] = {
    "angle_disagrees": _angle,
    "bends": "in bends the travel speed of a wheel differs from the vehicle's: by up to {most_m_s:.2g} m/s, in {n} "
    "rows by more than 1 %",
    "driven_not_known": _driven_not_known,
    "duplicate_rows": _duplicates,
    "grouser_count_missing": "the vehicle states lugs of {height_m:g} m without their number: their forces are "
    "not modelled; give grouser_count",
    "grouser_height_missing": "the vehicle states {count} lugs without their height: only their ripple with the angle "
    "of the wheel is modelled; give grouser_height_m",
    "load_computed": _load_computed,
    "load_unit": _load_unit,
    "one_radius": "wheels of {geometries} geometries: only those of radius {radius_m:g} m were used",
    "other_geometries": "rows of {wheels} wheels: only the {used} of the {wheel} were used, for their soils may "
    "differ; give the others in a file of their own",
    "other_wheels": "only the {used} of {n} rows were used that are of the vehicle's wheel by {columns}; give the "
    "others in a file of their own",
    "load_without_slope": "load_N was not sensed, and pitch_rad was not recorded. The load is computed from the "
    "vehicle's weight as on level ground, {load_N:.3g} N on average. On a slope load and slip change together, which "
    "looks like another soil: c and phi are not determined. Record the attitude (an IMU with orientation)",
    "pull_computed": _pull_computed,
    "pull_sign": "drawbar_pull_N falls as torque over radius rises (slope {slope:.2g}, correlation {correlation:.2f}). "
    "Its sign may be wrong (positive is forwards): {mend}",
    "pull_sign_by_slip": "drawbar_pull_N is forwards where slip is least and backwards where it is largest. Its sign, "
    "or that of slip, may be wrong (positive is forwards): {mend}",
    "pull_unit": _pull_units,
    "rows_without_time": _without_time,
    "settling_rows": _settling,
    "slip_definition": "{channel} falls at like loads as slip rises: check how slip is defined; if it is V/(r omega): "
    "{mend}",
    "slip_disagrees": _slip,
    "speed_unit": _speed_units,
    "stated_noise": "the noise stated of {channel}, {stated:.3g}, is less than a hundredth of what neighbours differ "
    "by ({shown:.2g}): check it; without it the noise is estimated from the data",
    "steady_trials": "rows lie too far apart in time for a drive, and are few or jump in slip or load: each row is "
    "taken as a steady trial",
    "stop_rows": _stops,
    "stuck_rows": "{channel} repeats one value in {n} rows, longer than chance allows: they are left out of it, as its "
    "sensor may hang",
    "stuck_channel": "{channel} never changes: it is left out, as its sensor may be stuck or absent",
    "torque_computed": _torque_computed,
    "towed_wheels": "{used} of {n} rows are of driven wheels and were used, for those of {wheels} are not driven",
    "travel_speed_computed": "travel_speed_m_s was not recorded. It is the change of the poses over {window_s:g} s, "
    "within {sd_m_s:.2g} m/s at a rim speed of {rim_m_s:.2g} m/s (the places scatter by {place_sd_m:.2g} m). Places "
    "that drift err by more",
    "travel_speed_of_wheels": "the poses are made from the wheels and give no travel speed ({how}): slip would be zero "
    "on any ground. A receiver's places, or an odometry that sees the ground, would do ([pose] in a topic map)",
    "travel_speed_uncertain": "the poses give no travel speed: it would be known to {sd_m_s:.2g} m/s only, over "
    "{window_s:g} s, at a rim speed of {rim_m_s:.2g} m/s (the places scatter by {place_sd_m:.2g} m)",
    "time_unit": "rows lie {step_s:.3g} s apart (median), yet slip and load change smoothly: check that time_s is in "
    "seconds",
    "torque_sign": "torque_Nm is {torque_Nm:.3g} N m (median) and above 0 in {share:.0%} of rows with a "
    "slip below {slip:g}, as if a braked wheel were driven. Check its sign there, and that of the slip; "
    "it is turned by {mend}",
}  # fmt: skip
"""A template for `str.format`, or a function of the values, by code."""


def sentence(finding: Finding) -> str:
    """Put a finding about rows into words."""
    return in_words(finding, SENTENCES)

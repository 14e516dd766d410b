"""Tables and figures of [T] in its order: what each is, and what a reader must know about its status."""

INTRODUCTION = """# Experiments

[T] is E. Sihite's [dissertation](https://escholarship.org/uc/item/2cd979dq) (UC San Diego, 2019): two
balancing robots, their models, filters and controllers. No robot and no motion capture was available: every
number here comes from the simulator, in which the real firmware runs. A simulation can show that a
published equation is wrong, or that a claim holds in a stated world; it cannot repeat a measurement. Each
row says what ran: filter, controller, gains and world, published or ours. Published numbers come from
[config/published.toml](../../config/published.toml), each experiment with the noise of its own section;
`tests/python/test_published.py` compares them field by field. Worlds: `thesis` is [T]'s own simulation;
`nominal` is as modelled, with sensor noise; `built2025` a typical built robot
([disturbances](../disturbances.md)). Numbers are medians over 20 seeds with their 5 to 95 % range, 60 s a
run unless stated; errors count after 5 s. The status follows from the findings on the experiment's page, by
rule; `tests/python/test_experiments.py` recomputes both from the data. `./tools/experiments all` runs
everything (half an hour on two cores); `./tools/experiments --from-data all` writes the same pages, byte
for byte, from `data/*.parquet`. What is wrong in [T]: [errata.md](../errata.md).""".splitlines()

IN_PLACE_HZ = ("0", "-1.5", "-1", "-0.75", "-0.5", "0.5", "0.75", "1", "1.5")  # Fig. 6.15 to 6.23

# Target: (what it is, what a reader must know besides the findings).
TARGETS = {
    "(2.1), Fig. 2.5": ("wobble of a double-row wheel", "[T] has no number"),
    "(2.2)": ("normal force over latitude", ""),
    "2.3.2": ("torque lost with untilted wheels", ""),
    "Table 2.1": ("orthogonal omniwheel orientations", "digits off by up to 0.04°"),
    "Fig. 2.10": ("motor and gearbox selection", "the identified motor's curve; nothing to spare"),
    "2.3.3": ("numbers of the motor's region of operation", "600 rpm is 0.785 m/s; 30° of tilt: 0.086 N m"),
    "Table 3.3, DMP": ("MIP attitude: the packets of the IMU", "their noise is put in"),
    "Table 3.3, planar EKF": ("MIP attitude: planar EKF", "our balance loop; (3.50), (3.51) are unstable"),
    "Table 3.3, high yaw-rate EKF": ("MIP attitude: [T]'s own EKF", "ours stands beside it on the page"),
    "Table 3.3, complementary filters": ("MIP attitude: complementary filter, KF", "the lever arm is fitted"),
    "Fig. 3.4a": ("MIP attitude over time at 0, 5, 10 rad/s", "held by our 200 Hz redesign of the loop"),
    "Fig. 3.4b": ("MIP accelerometer, measured and predicted", "the lever arm is fitted"),
    "(3.41), (3.42)": ("discrete high yaw-rate model of the MIP", "0.009 and -0.016 are wrong"),
    "(3.43), (3.47)": ("its yaw and accelerometer", ""),
    "(3.50), (3.51)": ("its tilt and wheel loops", "three digits; unstable at 100 Hz, too"),
    "(3.52)": ("its heading loop", ""),
    "4.4": ("3 to 5 iterations of Newton's method", "to 1e-3 of the duty"),
    "Fig. 4.2": ("current through one PWM period", ""),
    "Fig. 4.4": ("motor command of the bench", "a picture of the input; nothing to test"),
    "Fig. 4.5": ("measured and predicted current", "our motors obey the model"),
    "Table 4.4": ("R² of the current models", "our motors obey the model; cell 0.650 is misprinted"),
    "Table 4.4, motor 2 linear": ("linear model of motor 2 over PWM", "Table 4.3's L looks misprinted"),
    "Table 4.5": ("RMSE of the current models", "our motors obey the model"),
    "Fig. 4.6": ("attitude variance of the MIP behind three bridges", ""),
    "Fig. 4.6, 1 kHz": ("the exception at 1 kHz", "a limit cycle of [T]'s robot; none here"),
    "Fig. 4.6, uncompensated at 10 and 20 kHz": ("uncompensated, high PWM frequency", "[T]'s robot stood"),
    "Fig. 5.3": ("friction identification", "the friction is put in"),
    "Fig. 5.3, 11.5 %": ("flywheel 11.5 % heavier about y", "it takes motors 17 % apart"),
    "(5.28)": ("linear model of the MBBR", "410 for 502"),
    "(5.29)": ("its accelerometer", "digits of an IMU at 0.18 m, Table 5.2 has 0.13 m"),
    "(5.31), (5.33)": ("gyro of the high yaw-rate model", "theta_y for theta_x in h2"),
    "(5.32)": ("high yaw-rate model", "the transport term is missing"),
    "(6.10), Fig. 6.2": ("feedback and reference as drawn", "true states, (6.13)'s sign turned"),
    "(6.25)": ("speed from motion capture", "a two-step difference over one step"),
    "Fig. 6.3": ("non-minimum phase with an outer loop", "with (6.13)'s sign turned"),
    "(6.5)": ("wheel axes", "the third row has a misprint"),
    "(6.13)": ("sign of the outer loop", ""),
    "(6.22)": ("gains of the simulation", "unstable without any doubt: the sum of the poles is positive"),
    "(6.27)": ("gains of the friction experiment", "unstable, as (6.22)"),
    "(6.29)": ("gains of the first experiments", ""),
    "Fig. 6.4": ("simulated ball speed, friction not compensated", "by our controller, on the same samples"),
    "Fig. 6.5": ("ball speed, friction not compensated", "by our controller, on the same samples"),
    "Fig. 6.5, with compensation": ("ball speed with compensation", "the corrected filter is right without"),
    "Fig. 6.6": ("simulated spin at 1 Hz and drive at 20 cm/s", "falls as published; ours beside it"),
    "Fig. 6.8": ("accelerometer and prediction, friction in the model", "it follows from the formula"),
    "Fig. 6.9": ("EKF against mocap, 20 cm/s", "fitted world"),
    "Fig. 6.10": ("EKF against mocap, 0.25 Hz and 10 cm/s", "fitted world"),
    "Fig. 6.11": ("EKF against mocap, 0.5 Hz and 10 cm/s", "fitted world"),
    "Fig. 6.12": ("EKF against mocap, 1 Hz and 5 cm/s", "fitted world"),
    "Fig. 6.13": ("spectrum of the ball speed", "fitted world"),
    "Table 6.1, fit": ("estimation errors, the fitted runs", "14 settings for 14 numbers, seed 1, 15 s"),
    "Table 6.1, prediction": ("estimation errors, other seeds, 60 s", "what the fit carries over"),
    "Table 6.1, growth with the yaw rate": ("errors grow with the yaw rate", "it is the heading's drift"),
    "Table 6.2": ("gains for spinning in place", "nominal world beside it"),
    "Fig. 6.14": ("attitude errors of KF, EKF and DMP over yaw rate", "the DMP's noise is put in"),
    "Fig. 6.14, KF and EKF equal in ball speed": ("the remark that led to DMP+KF", ""),
    **{f"Fig. 6.{15 + i}": (f"in place, {hz} Hz", "the DMP's noise: put in")
       for i, hz in enumerate(IN_PLACE_HZ)},
    "Fig. 6.24": ("spectrum of the ball speed over drive speed", "rows' distance is put in"),
    "Fig. 6.24, band": ("vibration at 17 to 25 rad/s", "rollers pass at 19.5 (5 cm/s) to 78 rad/s (20 cm/s)"),
    "Table 6.3": ("gains for spinning and driving", "nominal world and scheduled gains beside it"),
    "Table 6.3, planar": ("the same on the planar model", "with (6.13)'s sign turned"),
    "Fig. 6.25": ("EKF in control, 0.5 Hz and 20 cm/s", ""),
    "Fig. 6.26": ("EKF in control, 0.75 Hz and 15 cm/s", ""),
    "Fig. 6.27": ("EKF in control, 1 Hz and 10 cm/s", "the published EKF falls"),
    "Fig. 6.28": ("EKF in control, 1.5 Hz and 5 cm/s", ""),
    "Fig. 6.29": ("DMP+KF in control, 0.5 Hz and 20 cm/s", "the DMP's noise is put in"),
    "Fig. 6.30": ("DMP+KF in control, 0.75 Hz and 15 cm/s", "the DMP's noise is put in"),
    "Fig. 6.31": ("DMP+KF in control, 1 Hz and 10 cm/s", "the DMP's noise is put in"),
    "Fig. 6.32": ("DMP+KF in control, 1.5 Hz and 5 cm/s", "our scheduled gains hold it"),
    "Identification to run": ("unknown robots identified, then run", "ours; nothing of [T]'s is claimed"),
    "6.4.6, DMP+KF outlasts the EKF": ("DMP+KF is the stabler controller at 1.5 Hz", ""),
}  # fmt: skip

"""The eduMIP under a controller of one's own: state feedback with the gains that design() has computed.

python examples/own_controller.py
"""

import equipoise_robot as eq
import numpy as np


class StateFeedback:
    """u = K (reference - estimate): what the robot's own LQR does, without its limits and soft start."""

    def __init__(self) -> None:
        gains = eq.design("mip", controller="lqr", last_hz=0.0).gains
        theta, phi, theta_dot, phi_dot, _ = gains["lqr"]
        self.K_x = np.array([theta, theta_dot, phi, phi_dot])
        self.K_z = np.array([gains["yaw_angle"], gains["yaw_rate"]])
        self.speed = gains["speed"]  # u that holds a wheel rate against the motors' back-EMF

    def __call__(self, tick: eq.ControllerTick) -> np.ndarray:
        # tick.error in the order of eq.error_names("mip"): theta, theta_dot, phi, phi_dot, psi, psi_dot
        u_x = self.K_x @ tick.error[:4] + self.speed * tick.reference.phi_dot_rad_s[0]
        u_z = self.K_z @ tick.error[4:]
        return np.clip([u_x, u_z], -1.0, 1.0)


if __name__ == "__main__":
    for controller in ("lqr", StateFeedback()):
        run = eq.run("mip", controller=controller, drive_mps=0.2, duration_s=20.0)
        print(f"{run.controller:14} {run.ended}, position error {run.position_rmse_m:.3f} m RMS")

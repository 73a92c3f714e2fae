"""A pendulum on a cart swings up: learned in the identified model, executed and caught in MuJoCo.

Only the cart has a drive. Nothing here is about an arm or a ball: a primitive of one joint, a
reward of one's own, the library's search, and a simulator of one's own around the library's.
"""

import numpy as np

import diffnea

WORLD = (
    "mujoco:cart_pole,perturb=A,seed=3"  # friction, masses and inertias are not the description's
)
ARRIVAL = slice(1500, 1650)  # looks at 500 Hz: 0.3 s after the motion

description = diffnea.load_model("cart_pole")
motion = diffnea.design_excitation(
    description,
    duration=10,
    harmonics=12,
    velocity_limits={"cart": 1.5},
    acceleration_limits={"cart": 8},
    seed=1,
)
recording = diffnea.simulate(description, motion.trajectory, world=WORLD, seed=1).recording
model = diffnea.identify(description, recording).model


# --- learn: the pole is upright and slow when the motion ends, and the cart stays on its rail ---


def from_upright(pole):
    return np.mod(pole, 2 * np.pi) - np.pi


def stands(rollouts):
    angle = np.abs(from_upright(rollouts["q_pole"][:, ARRIVAL])).mean(axis=1)
    speed = np.abs(rollouts["qd_pole"][:, ARRIVAL]).mean(axis=1)
    off_rail = np.maximum(np.abs(rollouts["q_cart"]).max(axis=1) - 0.9, 0)
    effort = np.mean(rollouts["qd_cart"] ** 2, axis=1)
    return -angle - 0.1 * speed - 10 * off_rail - 0.1 * effort


promp = diffnea.Promp(
    ["cart"], duration=3, hold=1, bases=12, held_first=1, held_last=0, returns=False
)
simulator = diffnea.model_simulator(model, controller=description, bandwidth=25)
rollouts = diffnea.Rollouts(simulator, promp, reward=stands)
start = diffnea.Gaussian(np.zeros(promp.size), 0.3**2 * np.eye(promp.size))
search = diffnea.Ereps(start, seed=1, samples=80, iterations=60)
while not search.done:
    search.tell(rollouts.run(search.ask()).rewards)
learned = rollouts.trace(search.policy.mean)
nearest = np.abs(from_upright(learned["q_pole"])).min()
print(f"in the model: reward {learned.reward:.2f}, {nearest:.2f} rad from upright at its nearest")


# --- execute: no motion that was planned holds a pole upright, so the cart balances it there ---


class Balanced(diffnea.Simulator):
    """The world, with a cart that leaves the planned motion once the pole can be caught."""

    def __init__(self, world, natural, coupling, poles):
        """Place all poles of φ'' = natural² φ − coupling x'', φ the angle from upright."""
        self.world = world
        self.joints, self.channels = tuple(world.joints), tuple(world.channels)
        self.period, self.lanes = world.period, world.lanes
        self.natural = natural
        of_x, of_v = poles**4 / natural**2, 4 * poles**3 / natural**2
        of_rate = (4 * poles + of_v) / coupling
        of_angle = (6 * poles**2 + natural**2 + of_x) / coupling
        self.gains = np.array([of_x, of_angle, of_v, of_rate])

    def reset(self, q, seeds):
        self.world.reset(q, seeds)
        self.caught = np.zeros(self.lanes, dtype=bool)
        self.q, self.qd = np.zeros((2, 1, self.lanes))

    def step(self, q, qd):
        state = self.world.observe()  # q_cart, q_pole, qd_cart, qd_pole
        state = np.stack([state[0], from_upright(state[1]), state[2], state[3]])
        # What grows, φ + φ'/natural, is small: the pole arrives, and slowly enough.
        self.caught |= (np.abs(state[1] + state[3] / self.natural) < 0.25) & (abs(state[1]) < 0.4)
        acceleration = np.clip(self.gains @ state, -15, 15)
        self.qd = np.where(self.caught, self.qd + self.period * acceleration, qd)
        self.q = np.where(self.caught, self.q + self.period * self.qd, q)
        self.world.step(self.q, self.qd)

    def observe(self):
        return self.world.observe()

    def failures(self):
        return self.world.failures()


upright = [0, np.pi]  # the identified model there: φ'' = natural² φ − coupling x''
inertia = diffnea.mass_matrix(model, q=upright)
falls = -diffnea.rnea_derivatives(model, q=upright, qd=[0, 0], qdd=[0, 0])[0][1, 1]
natural, coupling = np.sqrt(falls / inertia[1, 1]), inertia[1, 0] / inertia[1, 1]

world = Balanced(
    diffnea.world_simulator(WORLD, controller=description), natural, coupling, poles=3.5
)
seen = diffnea.Rollouts(world, promp, reward=stands).trace(search.policy.mean)
angle = np.abs(from_upright(seen["q_pole"][-250:])).max()
cart = np.abs(seen["q_cart"]).max()
print(f"in MuJoCo: {angle:.2f} rad from upright at most in the last half second")
print(f"the cart went {cart:.2f} m of 1 m; the pole {'stands' if angle < 0.2 else 'fell'}")

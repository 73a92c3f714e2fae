"""A task and a simulator of one's own, and ball in a cup with another reward."""

import numpy as np

import diffnea

# --- a simulator of one's own: a point mass that a spring pulls to where it should be ---


class PointMass(diffnea.Simulator):
    joints = ("x", "y")
    channels = ("q_x", "q_y")
    period = 0.02  # between two commands [s]
    lanes = 16  # worlds side by side, one a column

    def reset(self, q, seeds):
        self.q = np.zeros((2, self.lanes))
        self.q[:, : q.shape[1]] = q
        self.qd = np.zeros_like(self.q)

    def step(self, q, qd):
        self.qd += self.period * (100 * (q - self.q) + 20 * (qd - self.qd))
        self.q += self.period * self.qd

    def observe(self):
        return self.q


# --- a reward as a function of whole rollouts: rollouts["q_x"] is (N, T) ---

GOAL = (0.3, -0.2)


def to_goal(rollouts):
    return -np.hypot(rollouts["q_x"][:, -1] - GOAL[0], rollouts["q_y"][:, -1] - GOAL[1])


promp = diffnea.Promp(["x", "y"], duration=1.0, hold=0.5, bases=6, held_last=0, returns=False)
rollouts = diffnea.Rollouts(PointMass(), promp, reward=to_goal)
start = diffnea.Gaussian(np.zeros(promp.size), 0.25 * np.eye(promp.size))
search = diffnea.Ereps(start, seed=1, samples=40)
while not search.done:
    search.tell(rollouts.run(search.ask()).rewards)
trace = rollouts.trace(search.policy.mean)
print(f"point mass: {1e3 * -trace.reward:.1f} mm from the goal")


# --- a task that sees look by look, where one is needed: observation["ball_z"] is (count,) ---


class Above(diffnea.Task):
    """The ball as high above the cup as can be; too far from its axis ends the episode."""

    def begin(self, simulator, count):
        self.most = np.full(count, -np.inf)

    def look(self, time, observation, ended):
        height = observation["ball_z"] - observation["cup_z"]
        self.most = np.where(ended, self.most, np.maximum(self.most, height))
        ended |= np.abs(observation["ball_x"] - observation["cup_x"]) > 0.6

    def rewards(self):
        return self.most


high = diffnea.learn("wam4_ball_in_cup", Above(), iterations=5, samples=24)
print(f"ball: {high.policies[0].expected:.2f} m above the cup after 5 iterations")


# --- ball in a cup itself, and what becomes of it in MuJoCo ---

learned = diffnea.learn("wam4_ball_in_cup", seeds=2)
print(learned)
print(diffnea.transfer(learned, repetitions=3))

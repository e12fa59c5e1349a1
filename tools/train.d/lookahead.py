"""Lookahead (Zhang et al. 2019) around another optimiser: every k steps the slow weights go a share alpha of the way to the fast ones."""

import torch


class Lookahead:
    def __init__(self, optimiser, k=5, alpha=0.5):
        self.optimiser, self.k, self.alpha, self.steps = optimiser, k, alpha, 0
        self.weights = [weight for group in optimiser.param_groups for weight in group["params"]]
        self.slow = [weight.detach().clone() for weight in self.weights]

    def zero(self):
        self.optimiser.zero_grad(set_to_none=True)

    def rate(self, rate):
        for group in self.optimiser.param_groups:
            group["lr"] = rate

    @torch.no_grad()
    def step(self):
        self.optimiser.step()
        self.steps += 1
        if self.steps % self.k == 0:
            for slow, fast in zip(self.slow, self.weights):
                slow.lerp_(fast, self.alpha)
                fast.copy_(slow)

    def state(self):
        return {"optimiser": self.optimiser.state_dict(), "slow": self.slow, "steps": self.steps}

    def restore(self, state):
        self.optimiser.load_state_dict(state["optimiser"])
        self.steps = state["steps"]
        for slow, saved in zip(self.slow, state["slow"]):
            slow.copy_(saved)

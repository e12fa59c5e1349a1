"""One training: a net, its optimiser, where it is in its data; saved and resumed with all of it."""

import math
import random
import time

import torch
from active import fuse
from lookahead import Lookahead
from loss import loss, mse, ssim2, ssim3
from network import Net

RATE = 1e-3


def device():
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def processor():
    """What trains, in words."""
    if torch.cuda.is_available():
        return torch.cuda.get_device_name()
    try:
        with open("/proc/cpuinfo") as file:
            names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
        return f"{names[0]}, {torch.get_num_threads()} threads"
    except (OSError, IndexError):
        return f"processor, {torch.get_num_threads()} threads"


class Session:
    def __init__(self, settings, examples, checks):
        """`settings` is a dict of what was asked for; `checks` the examples that judge, by the name of their set."""
        self.settings, self.examples, self.checks = settings, examples, checks
        self.device = device()
        torch.manual_seed(settings["seed"])
        self.random = random.Random(settings["seed"])
        self.net = Net(settings["shape"], settings["injection"]).to(self.device)
        self.optimiser = Lookahead(torch.optim.RAdam(self.net.parameters(), RATE))
        self.rate, self.stale, self.best = RATE, 0, math.inf
        self.steps, self.epochs, self.seconds = 0, 0, 0.0
        self.order, self.history, self.sum, self.count = [], [], 0.0, 0

    # --- steps ---------------------------------------------------------------------------------------------------------

    def choose(self):
        """Measures a step in f32 and in bf16, which many processors are faster with and some a lot slower, and takes the faster one.
        Returns seconds a step. Weights and loss are f32 in any case."""
        fuse(self.device)
        found = {}
        for precision in (torch.float32, torch.bfloat16):
            self.net.precision = precision
            times = []
            for _ in range(3):
                start = time.perf_counter()
                self.backward(0, 0)
                self.synchronise()
                times.append(time.perf_counter() - start)
            found[precision] = min(times)
        self.optimiser.zero()
        self.net.precision = min(found, key=found.get)
        return found[self.net.precision]

    def synchronise(self):
        if self.device.type == "cuda":
            torch.cuda.synchronize()

    def backward(self, example, symmetry):
        grid, truth, points = self.examples.get(example, self.device, symmetry)
        self.optimiser.zero()
        value = loss(self.settings["loss"], self.net(grid, points), truth)
        value.backward()
        return value.item()

    def step(self):
        if not self.order:
            self.order = list(range(len(self.examples)))
            self.random.shuffle(self.order)
            self.epochs += 1
        self.optimiser.rate(self.rate)
        value = self.backward(self.order.pop(), self.random.randrange(48))
        if not math.isfinite(value):
            raise SystemExit(f"step {self.steps}: the loss is {value}")
        self.optimiser.step()
        self.steps += 1
        self.sum += value
        self.count += 1

    # --- errors --------------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def judge(self):
        """Errors of every example of every set, with its source."""
        out = []
        for name, examples in self.checks.items():
            for i in range(len(examples)):
                grid, truth, points = examples.get(i, self.device)
                found = self.net(grid, points)
                errors = {
                    "loss": loss(self.settings["loss"], found, truth),
                    "ssim2": ssim2(found, truth),
                    "ssim3": ssim3(found, truth),
                    "mse": mse(found, truth),
                    "bias": (found - truth).mean(),
                    # What a net that always gives the mean would have.
                    "variance": truth.var(correction=0),
                }
                out.append({"set": name} | examples.list[i] | {key: value.item() for key, value in errors.items()})
        return out

    def validate(self):
        """A row of the curve, and the rate halved where two did not get better (unless it was planned how it falls)."""
        judged = [row for row in self.judge() if row["set"] == "validation"]
        mean = {key: sum(row[key] for row in judged) / len(judged) for key in ("loss", "ssim2", "ssim3", "mse")}
        row = {"minutes": self.seconds / 60, "step": self.steps, "rate": self.rate, "loss": self.sum / max(self.count, 1)}
        row |= {"validation_loss": mean.pop("loss")} | mean
        self.history.append(row)
        self.sum, self.count = 0.0, 0
        if row["validation_loss"] < self.best:
            self.best, self.stale = row["validation_loss"], 0
        else:
            self.stale += 1
            if not self.settings["planned"] and self.stale % 2 == 0:
                self.rate /= 2
        return row

    def cooled(self, share):
        """The rate when this share of the minutes is over: a cosine to 0."""
        self.rate = 0.5 * RATE * (1 + math.cos(math.pi * min(share, 1.0)))

    # --- files ---------------------------------------------------------------------------------------------------------

    KEPT = ("rate", "stale", "best", "steps", "epochs", "seconds", "order", "history", "sum", "count")

    def save(self, path):
        state = {key: getattr(self, key) for key in self.KEPT}
        state |= {"net": self.net.state_dict(), "optimiser": self.optimiser.state()}
        state |= {"random": self.random.getstate(), "torch": torch.get_rng_state(), "settings": self.settings}
        partial = path.with_suffix(".partial")
        torch.save(state, partial)
        partial.replace(path)

    def restore(self, path):
        # Its own file: it holds more than tensors.
        state = torch.load(path, map_location=self.device, weights_only=False)
        for key in ("shape", "injection", "loss", "seed"):
            if state["settings"][key] != self.settings[key]:
                raise SystemExit(f"{path}: of {key} {state['settings'][key]}, asked for {self.settings[key]}; expected the same, or another --run")
        for key in self.KEPT:
            setattr(self, key, state[key])
        # Of examples that are there now.
        self.order = [i for i in self.order if i < len(self.examples)]
        self.net.load_state_dict(state["net"])
        self.optimiser.restore(state["optimiser"])
        self.random.setstate(state["random"])
        torch.set_rng_state(state["torch"].cpu())

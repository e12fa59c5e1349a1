"""Examples as `cao examples` writes them, in memory, and the 48 symmetries of a cube."""

import itertools
import json
import pathlib

import numpy
import torch

# Where volumes that are no built-in ones come from; tools/get-data fetches them. Of each its kind.
GIVEN = {
    "cranium.mhd": ("CT", "head, CT; InVesalius' example data, CTI Renato Archer; GPL-2"),
    "torso.nii.gz": ("CT", "ribs and spine, CT; TotalSegmentator s0024, Wasserthal et al. 2023; CC BY 4.0"),
    "brain.nii.gz": ("MR", "brain, MR; MRIcron's template ch2better, Chris Rorden; BSD-3-Clause"),
    "head": ("CT", "head, CT, DICOM; Visible Human Male, U.S. National Library of Medicine; public domain"),
}


def kind(source, given):
    """Kind and credit of a source."""
    if given:
        return GIVEN.get(source, ("other", "a volume of one's own"))
    return ("phantom", "made by this program; its own licence")


class Examples:
    """The examples of some folders, with the cubes that a training needs."""

    def __init__(self, folders, label, injection="preclassified"):
        self.cubes = ["values" if injection == "latent" else "opacity", label]
        self.list, self.data, self.points = [], [], []
        self.edge = None
        for folder in map(pathlib.Path, folders):
            index = json.loads((folder / "examples.json").read_text())
            if self.edge not in (None, index["edge"]):
                raise SystemExit(f"{folder}: cubes of {index['edge']} voxels; expected {self.edge} as in the others")
            self.edge = index["edge"]
            missing = set(self.cubes) - set(index["cubes"])
            if missing:
                raise SystemExit(f"{folder}: has no {', '.join(missing)}; it has {', '.join(index['cubes'])}")
            wanted = [index["cubes"].index(cube) for cube in self.cubes]
            data = numpy.memmap(folder / "examples.u16", "<u2", "r", shape=(len(index["examples"]), len(index["cubes"]), *[self.edge] * 3))
            for i, example in enumerate(index["examples"]):
                self.data.append(data[i, wanted])
                self.points.append(torch.tensor(example["transfer"], dtype=torch.float32)[None])
                kind_of, credit = kind(example["source"], example["given"])
                self.list.append({"source": example["source"], "kind": kind_of, "credit": credit})

    def __len__(self):
        return len(self.data)

    def get(self, i, device, symmetry=0):
        """What goes in and what is to come out, each [1, 1, z, y, x], and the transfer function's points, [1, n, 2]."""
        axes, flips = SYMMETRIES[symmetry]
        # Copied by NumPy: flips are negative strides.
        cubes = self.data[i].transpose(0, *axes)[(slice(None), *[slice(None, None, step) for step in flips])]
        cubes = torch.from_numpy(numpy.ascontiguousarray(cubes).astype(numpy.float32)).to(device) / 65535.0
        return cubes[0][None, None], cubes[1][None, None], self.points[i].to(device)


SYMMETRIES = [
    (axes, flips) for axes in itertools.permutations((1, 2, 3)) for flips in itertools.product((1, -1), repeat=3)
]

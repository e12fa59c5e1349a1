// Below this q = 1 - a counts as 0: log(q) of a rounded 0 would be anything.
const OPAQUE = 1e-6;

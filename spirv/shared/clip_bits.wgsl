// A bit for each clip.

const MOST_CLIPS = 8u;
const ALL_CLIPS = (1u << MOST_CLIPS) - 1u;

//! The renderer as a whole, and what is measured of it: exact updates, both eyes, hosts, failures, leaks, budgets.

mod adopt;
mod bands;
mod budget;
mod calls;
mod consistency;
mod contextual;
mod deform;
mod edits;
mod embed;
mod exactness;
mod external;
mod failures;
mod fit;
mod frames;
mod guest;
mod host;
mod host_image;
mod leaks;
mod lengths;
mod limits;
mod methods;
mod planner;
mod real_data;
mod samples;
mod scenes;
mod stability;

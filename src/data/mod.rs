//! Bytes to scene types: the only place that knows formats; and the dataset that needs no bytes.

pub mod synthetic;

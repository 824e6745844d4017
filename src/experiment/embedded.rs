//! The experiment files of this repository, for a program that runs away from it.

/// The six tables of the paper: file name and text of each.
pub const EMBEDDED: &[(&str, &str)] = &[
    ("experiments/table1.toml", include_str!("../../experiments/table1.toml")),
    ("experiments/table2.toml", include_str!("../../experiments/table2.toml")),
    ("experiments/table3.toml", include_str!("../../experiments/table3.toml")),
    ("experiments/table4.toml", include_str!("../../experiments/table4.toml")),
    ("experiments/table5.toml", include_str!("../../experiments/table5.toml")),
    ("experiments/table6.toml", include_str!("../../experiments/table6.toml")),
];

/// Experiments of our own.
pub const FURTHER: &[(&str, &str)] = &[
    (
        "experiments/attribution-animatable.toml",
        include_str!("../../experiments/attribution-animatable.toml"),
    ),
    ("experiments/attribution-hugs.toml", include_str!("../../experiments/attribution-hugs.toml")),
    ("experiments/attribution-ihuman.toml", include_str!("../../experiments/attribution-ihuman.toml")),
    (
        "experiments/attribution-splattingavatar.toml",
        include_str!("../../experiments/attribution-splattingavatar.toml"),
    ),
    ("experiments/bend.toml", include_str!("../../experiments/bend.toml")),
    ("experiments/budget.toml", include_str!("../../experiments/budget.toml")),
    ("experiments/ci.toml", include_str!("../../experiments/ci.toml")),
    ("experiments/demo.toml", include_str!("../../experiments/demo.toml")),
    ("experiments/engines.toml", include_str!("../../experiments/engines.toml")),
    ("experiments/lights.toml", include_str!("../../experiments/lights.toml")),
    ("experiments/noise.toml", include_str!("../../experiments/noise.toml")),
    ("experiments/parts.toml", include_str!("../../experiments/parts.toml")),
    ("experiments/pushforward.toml", include_str!("../../experiments/pushforward.toml")),
    ("experiments/swap.toml", include_str!("../../experiments/swap.toml")),
    ("experiments/tuning.toml", include_str!("../../experiments/tuning.toml")),
];

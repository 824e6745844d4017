//! Being told to stop: SIGINT (Ctrl-C) and SIGTERM (batch systems) end the program at once, in a state from which it goes on.
//!
//! Stores drop a torn line, other files appear complete or not at all, so that nothing has to be waited for.

/// Begins to listen. `advice` says how to go on.
#[cfg(unix)]
pub(super) fn listen(advice: String) -> std::io::Result<()> {
    use super::output::say;
    use signal_hook::consts::{SIGINT, SIGTERM};
    use skinsplat_data::atomic;
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let _abandoned = atomic::abandon();
            say(format_args!("stopped by {}: {advice}", if signal == SIGINT { "SIGINT" } else { "SIGTERM" }));
            #[expect(clippy::exit, reason = "other threads are in the middle of what nobody waits for")]
            std::process::exit(128 + signal);
        }
    })?;
    Ok(())
}

/// Other systems end a program without a word; what it leaves is swept by the next run.
#[cfg(not(unix))]
pub(super) fn listen(_advice: String) -> std::io::Result<()> {
    Ok(())
}

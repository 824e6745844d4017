#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| skinsplat_fuzz::run("transforms", bytes));

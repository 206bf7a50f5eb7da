//! Registers that depend on the type of controller, 0x0E00..0x0F1F (protocol 3.13).

number_register! {
    /// Register PRODUCT_ID (0x0E00): product id, or the power-on values of the pins.
    ProductId(u64, reset 0)
}

number_register! {
    /// Register DIGITAL_OUTPUTS (0x0F00).
    DigitalOutputs(u32, reset 0)
}

number_register! {
    /// Register GPO (0x0F10): general purpose outputs.
    Gpo(u64, reset 0)
}

number_register! {
    /// Register GPI (0x0F18): general purpose inputs.
    Gpi(u64, reset 0)
}

"""What tests, benchmarks and authors of drivers put mocks to work with. It may import everything; nothing imports it.

In memory, on a clock in the test's hand: `wire`, `clock`, `epos4`, `ndi`, `force`. In a process of their own and in
real time: `remote` (one mock), `commands` (the whole bench, and `rig` commands against it), `service` (`rig serve`),
`access` (credentials for it). Controllers without devices: `spring_bench`, `limb_bench`. Tissue models with known
parameters: `models`.
"""

"""Train the paper's two behaviours and ask a policy where it would rather have its target."""

import numpy as np

from kumite import approach, builtin_layer, solve, strike

library = builtin_layer(None)
for behaviour in (approach(), strike(library)):
    policy = solve(library, behaviour)
    grid = behaviour.grid
    best = grid.points[np.argmax(policy.value.mean(axis=0))]
    print(
        f"{behaviour.name}: {policy.sweeps} sweeps, residual {policy.residual:.1e}, "
        f"{policy.backups / policy.seconds:.1e} backups/s, {policy.value.nbytes / 1e6:.2f} MB; "
        f"likes the target at x {best[0]:+.2f}, z {best[2]:+.2f} m"
    )

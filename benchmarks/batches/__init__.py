"""Many runs of one model: msahl.batch, MuJoCo's rollout, Exudyn's ParameterVariation."""

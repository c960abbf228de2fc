"""Mechanisms of the methods and the robots: what each part has to do, whatever the paper's tasks need of it."""

from evoclaims import claim


@claim(
    "K1",
    says="In NEAT the fittest quarter of a species, and only that, has the offspring, and the fittest genome lives on",
    where="mechanism",
    smoke="In NEAT the fittest quarter of a species, and only that, has the offspring, and the fittest genome lives on",
)
def test_neat_selects_the_fittest(trials, verdict):
    """Parents drawn evenly from the fittest quarter are fitter than 7/8 of their species."""
    neat = trials("neat_mechanisms", on="two_niches")
    verdict(neat.on_average("selection").between(0.86, 0.90) & neat.always("elite", 1).in_most_trials())


@claim(
    "K2",
    says="In NEAT children of two parents have the structure of the fitter one, and numbers of both",
    where="mechanism",
    smoke="In NEAT children of two parents have the structure of the fitter one, and numbers of both",
)
def test_structure_comes_from_the_fitter_parent(trials, verdict):
    neat = trials("neat_mechanisms", on="two_niches")
    of_fitter = neat.share("structure_of_fitter", "structure_of_other") > 0.9
    verdict(of_fitter & neat.share("genes_of_other", "genes_of_fitter").between(0.35, 0.5))


@claim(
    "K3",
    says="In NEAT species protect a niche that earns less, until it has not improved for five generations",
    where="mechanism",
    smoke="In NEAT species protect a niche that earns less, until it has not improved for five generations",
)
def test_species_protect_a_niche_as_long_as_patience_lasts(trials, verdict):
    """The niche goes half of the way to a third of 64 genomes, six times, and dies: 134 genomes in ten generations.

    It improves once, when it is new. Of 640 genomes, 134 are 0.209; one more or less in each generation is 0.009.
    """
    verdict(trials("neat_mechanisms", on="two_niches").on_average("niche").between(0.2, 0.219))


@claim(
    "K4",
    says="CMA-ES approaches the optimum of a sphere at the rate of Hansen's equations, and leaves it a sphere",
    where="mechanism",
    smoke="CMA-ES approaches the optimum of a sphere at the rate of Hansen's equations, and leaves it a sphere",
)
def test_cma_es_converges_on_a_sphere(trials, verdict):
    """The rate and the noise of the covariance are those of his equations in NumPy, in at least 98 of 100 runs."""
    sphere = trials("cma_es_mechanisms", on="sphere")
    verdict(sphere.fall("log_error").between(0.18, 0.262) & sphere.at_the_end("condition").between(1.9, 5.0))


@claim(
    "K5",
    says="CMA-ES learns the covariance of a rotated ellipsoid, and as fast as by Hansen's equations",
    where="mechanism",
    smoke="CMA-ES learns the covariance of a rotated ellipsoid, and as fast as by Hansen's equations",
)
def test_cma_es_learns_an_ellipsoid(trials, verdict):
    """Of a condition of 10,000 what is left is noise, as on a sphere."""
    ellipsoid = trials("cma_es_mechanisms", on="ellipsoid")
    verdict(ellipsoid.at_the_end("condition").between(2.0, 5.0) & ellipsoid.fall("log_error").between(0.13, 0.22))


@claim(
    "K6",
    says="The archive of MAP-Elites holds the best that ever ended in each cell, and new elites vary old ones",
    where="mechanism",
    smoke="The archive of MAP-Elites holds the best that ever ended in each cell, and new elites vary old ones",
)
def test_the_archive_keeps_the_better(trials, verdict):
    archive = trials("map_elites_mechanisms", on="spread")
    right = archive.always("kept", 1).in_every_trial() & archive.always("true", 1).in_every_trial()
    varied = archive.on_average("near").between(0.7, 1.1) & archive.on_average("line").between(0.95, 1.05)
    verdict(right & archive.always("best", 1).in_every_trial() & varied)


@claim(
    "K7",
    says="A robot's rays end where a walk along them first meets a box",
    where="mechanism",
    smoke="A robot's rays end where a walk along them first meets a box",
)
def test_rays_end_at_boxes(trials, verdict):
    verdict(trials("wanderers", on="room").at_the_end("rays") > 0.98)


@claim(
    "K8",
    says="A robot's motors push it for as many frames as a step has",
    where="mechanism",
    smoke="A robot's motors push it for as many frames as a step has",
)
def test_motors_are_held_for_all_frames(trials, verdict):
    verdict(trials("wanderers", on="room").at_the_end("frames") > 0.98)


@claim(
    "K9",
    says="A step of PPO makes actions likelier that did better than expected, and others less likely",
    where="mechanism",
    smoke="A step of PPO makes actions likelier that did better than expected, and others less likely",
)
def test_a_step_follows_the_advantages(trials, verdict):
    """Steps that know nothing of advantages correlate with them by chance: 0, with a deviation of 0.03 at most."""
    verdict(trials("ppo_mechanisms", on="stroll").on_average("aligned") > 0.1)


@claim(
    "K10",
    says="A step of PPO ends where its equations lead: returns, advantages, clipped ratios, entropy and Adam",
    where="mechanism",
    smoke="A step of PPO ends where its equations lead: returns, advantages, clipped ratios, entropy and Adam",
)
def test_a_step_is_that_of_the_equations(trials, verdict):
    """Where some densities leave their bounds; the policy's step has noise, since Brax draws what its entropy is."""
    ppo = trials("ppo_mechanisms", on="stroll")
    right = (ppo.on_average("value_error") < 0.001) & (ppo.on_average("policy_error") < 0.04)
    verdict(right & (ppo.on_average("clipped") > 0.1))


@claim(
    "K11",
    says="PPO learns from what its actions led to, whitened by all it saw, each trajectory once a pass in a new order",
    where="mechanism",
    smoke="PPO learns from what its actions led to, whitened by all it saw, each trajectory once a pass in a new order",
)
def test_a_step_uses_all_that_was_collected(trials, verdict):
    """Orders of 1,024 trajectories correlate by chance: 0, with a deviation of 1 / 32."""
    ppo = trials("ppo_mechanisms", on="stroll")
    right = ppo.always("whitened", 1).in_every_trial() & ppo.always("divided", 1).in_every_trial()
    verdict(right & (ppo.on_average("recorded") > 0.99) & (ppo.on_average("alike") < 0.2))


@claim(
    "K12",
    says="HyperNEAT's weights are what its CPPN answers at the neurons' places, beyond the threshold",
    where="mechanism",
    smoke="HyperNEAT's weights are what its CPPN answers at the neurons' places, beyond the threshold",
)
def test_weights_are_drawn_from_places(trials, verdict):
    drawn = trials("hyperneat_mechanisms", on="portrait")
    verdict((drawn.on_average("weights") > 0.999) & (drawn.on_average("various") > 0.5))


@claim(
    "K13",
    says="In HyperNEAT the genome whose network answers best lives on, and answers get better",
    where="mechanism",
    smoke="In HyperNEAT the genome whose network answers best lives on, and answers get better",
)
def test_hyperneat_selects_by_what_networks_answer(trials, verdict):
    drawn = trials("hyperneat_mechanisms", on="portrait")
    verdict((drawn.on_average("fittest") > 0.95) & (drawn.fall("error") > 0))

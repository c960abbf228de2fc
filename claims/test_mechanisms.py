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
    """A niche whose fitness stays the same improves once, when it is new, and has a third of the population."""
    verdict(trials("neat_mechanisms", on="two_niches").reports_above("niche", 0.25).between(6, 6))


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
    verdict(right & archive.always("best", 1).in_every_trial() & archive.on_average("near").between(0.7, 1.1))


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

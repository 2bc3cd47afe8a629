"""Training runs."""

from __future__ import annotations

import csv
import dataclasses

import numpy as np
import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.architectures import ARCHITECTURES
from emd_planner.augmentation import Examples
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig, SpatialNetConfig
from emd_planner.recipe import Losses, learning_rate_share, make_recipe
from emd_planner.sequence_files import load_sequences
from emd_planner.train import main, train
from emd_planner.trainer import Run, Trainer
from emd_planner.training_config import RECIPES, AugmentationConfig, TrainingConfig
from emd_planner.validation import Validator, mean_grid
from emd_planner.weights import load_net, read_provenance

QUARTER_TURNS = AugmentationConfig(free_share=0.0, near_miss_share=0.0)
SHORT = TrainingConfig(
    batch_size=4, validation_share=0.2, bfloat16=False, augmentation=QUARTER_TURNS
)


@pytest.fixture
def data(shard_directory):
    """Twelve made-up sequences."""
    return load_sequences([shard_directory])


def examples_of(grids, manipulations):
    """Examples in which both hands always grasp."""
    used = torch.ones(*manipulations.shape[:2], 2, dtype=torch.bool)
    return Examples(grids, manipulations, used)


def test_a_net_overfits_four_examples(data):
    """With our recipe, only quicker, the loss on four examples falls to a tenth."""
    config = dataclasses.replace(TrainingConfig(), learning_rate=3e-3, consistency_weight=0.01)
    net = EmdNet(
        EmdNetConfig(
            grid_size=(16, 16, 4),
            map_counts=(1, 8, 16, 32, 64),
            strides=((2, 2, 1), (2, 2, 2), (2, 2, 2), (2, 2, 1)),
            manipulation_layers=4,
            hidden_size=32,
        )
    )
    recipe = make_recipe(net, config)
    windows = data.windows(data.window_starts(1)[:4], 1)
    grids = windows.grids[:, :, ::2, ::2, :4]
    manipulations = windows.manipulations.nan_to_num(0.9)
    history = []
    while len(history) < 400 and (not history or history[-1] > 0.1 * history[0]):
        losses = Losses(net, examples_of(grids, manipulations))
        history.append(losses.state.item())
        recipe.step(losses, 0.1)
    assert history[-1] <= 0.1 * history[0]


def test_cross_entropy_and_squared_error_are_of_the_same_predictions(data, small_config):
    """Both objectives equal what is computed from `predict_all`, and both have gradients."""
    net = EmdNet(small_config)
    windows = data.windows(data.window_starts(2)[:3], 2)
    manipulations = windows.manipulations.nan_to_num(0.9)
    losses = Losses(net, examples_of(windows.grids, manipulations), reconstruct=True)
    predicted = net.predict_all(windows.grids[:, 0], manipulations)
    actual = windows.grids[:, 1:].float()
    torch.testing.assert_close(losses.state, (predicted - actual).square().mean())
    entropy = torch.where(windows.grids[:, 1:], predicted, 1.0 - predicted).log().mean()
    torch.testing.assert_close(losses.cross_entropy, -entropy)
    decoded = net.decode(net.encode(windows.grids[:, 0]))
    first = windows.grids[:, 0].float()
    torch.testing.assert_close(losses.reconstruction, (decoded - first).square().mean())
    codes = torch.stack(net.roll_out(net.encode(windows.grids[:, 0]), manipulations), 1)
    encoded = net.encode(windows.grids[:, 1:].flatten(0, 1)).unflatten(0, (3, 2))
    torch.testing.assert_close(losses.consistency, (codes - encoded).square().mean())


def test_the_papers_recipe_lowers_both_losses(data, small_config):
    """The Manhattan rule descends as well, by its small steps."""
    config = dataclasses.replace(RECIPES["paper"], learning_rate=1e-3)
    net = EmdNet(small_config)
    recipe = make_recipe(net, config)
    windows = data.windows(data.window_starts(1)[:8], 1)
    manipulations = windows.manipulations.nan_to_num(0.9)
    examples = examples_of(windows.grids, manipulations)
    first = Losses(net, examples)
    for _ in range(50):
        recipe.step(Losses(net, examples), 0.5)
    last = Losses(net, examples)
    assert last.state < 0.7 * first.state


@pytest.mark.parametrize("recipe", ["ours", "paper"])
def test_an_interrupted_run_ends_with_the_same_weights(data, small_config, tmp_path, recipe):
    """A run stopped after 3 of 6 batches and started again equals one without a break."""
    config = dataclasses.replace(RECIPES[recipe], batch_size=4, augmentation=QUARTER_TURNS)
    whole = Run(tmp_path / "whole", iterations=6, seed=2)
    broken = Run(tmp_path / "broken", iterations=6, seed=2)
    reference = train(data, small_config, config, whole)
    assert train(data, small_config, config, broken, should_stop=lambda done: done == 3) is None
    assert not (tmp_path / "broken" / "emd_net.safetensors").exists()
    resumed = train(data, small_config, config, broken)
    assert reference is not None and resumed is not None
    one, other = load_net(reference).state_dict(), load_net(resumed).state_dict()
    assert all(torch.equal(one[name], other[name]) for name in one)
    initial = EmdNet(small_config, seed=2).state_dict()
    assert not torch.equal(initial["decoder.layers.0.weight"], one["decoder.layers.0.weight"])


def test_a_checkpoint_of_another_run_is_refused(data, small_config, tmp_path):
    """Going on with other options or another seed is refused, and says which differ."""
    run = Run(tmp_path, iterations=2)
    train(data, small_config, SHORT, run, should_stop=lambda done: done == 1)
    with pytest.raises(InvalidInputError, match="another seed"):
        train(data, small_config, SHORT, dataclasses.replace(run, seed=1))
    with pytest.raises(InvalidInputError, match="another training"):
        train(data, small_config, dataclasses.replace(SHORT, batch_size=8), run)
    (tmp_path / "checkpoint.pt").write_bytes(b"broken")
    with pytest.raises(InvalidInputError, match="delete it"):
        train(data, small_config, SHORT, run)


def test_a_run_leaves_its_scores_weights_and_origin(data, small_config, tmp_path):
    """CSV, picture, weights and provenance lie in the output directory."""
    rows = []
    config = dataclasses.replace(SHORT, validate_every=0.0)
    out = tmp_path / "out"
    path = train(data, small_config, config, Run(out, iterations=3, command="c"), rows.append)
    assert path is not None
    assert {file.name for file in out.iterdir()} == {
        "checkpoint.pt",
        "curve.png",
        "emd_net.json",
        "emd_net.safetensors",
        "log.csv",
        "tensorboard",
    }
    with open(out / "log.csv", newline="") as stream:
        logged = list(csv.DictReader(stream))
    assert [float(row["one_step"]) for row in logged] == [row["one_step"] for row in rows]
    assert all(row["manipulations_per_s"] > 0.0 and row["peak_share"] > 0.0 for row in rows)
    assert b"peak_share" in next((out / "tensorboard").iterdir()).read_bytes()
    origin = read_provenance(path)
    assert origin["command"] == "c"
    assert origin["iterations"] == 3
    assert origin["data_sha256"] == data.content_hash
    assert origin["training_manipulations"] == 30


def test_a_run_can_start_from_weights(data, small_config, tmp_path):
    """A second run goes on from the first one's weights, as with the robot's data (III-B)."""
    first = train(data, small_config, SHORT, Run(tmp_path / "first", iterations=2))
    config = dataclasses.replace(SHORT, learning_rate=1e-12, weight_decay=0.0)
    run = Run(tmp_path / "second", iterations=1, start_from=first)
    second = train(data, small_config, config, run)
    one, other = load_net(first).state_dict(), load_net(second).state_dict()
    for name in one:
        torch.testing.assert_close(one[name], other[name])


def test_a_share_of_each_batch_is_mixed_in(tmp_path, write_shards, small_config):
    """As large as asked for, though there are far fewer; without it batches are as before."""
    write_shards(tmp_path / "many", 40)
    write_shards(tmp_path / "few", 10, seed=1)
    data = load_sequences([tmp_path / "many"], mix=[tmp_path / "few"])
    config = dataclasses.replace(SHORT, batch_size=400)
    trainer = Trainer(data, small_config, config, Run(tmp_path / "out", 1.0, mix_share=0.75))
    starts = trainer._draw_starts(torch.Generator().manual_seed(0))
    assert 0.65 < np.isin(starts, trainer.mixed_starts).mean() < 0.85
    assert set(trainer.mixed_starts).isdisjoint(trainer.starts)
    with pytest.raises(InvalidInputError, match="both are needed"):
        Trainer(
            dataclasses.replace(data, mixed=np.ones(50, dtype=bool)),
            small_config,
            config,
            Run(tmp_path / "none", 1.0),
        )
    with pytest.raises(InvalidInputError, match="0..1"):
        Run(tmp_path, mix_share=1.5)


def test_a_run_without_an_end_is_refused(data, small_config, tmp_path):
    """Neither minutes nor iterations: refused."""
    with pytest.raises(InvalidInputError, match="minutes or iterations"):
        train(data, small_config, SHORT, Run(tmp_path))


def test_baselines_are_what_they_say(data, small_config):
    """Do nothing, empty and mean grid score as computed from the windows directly."""
    validator = Validator(data, mean_grid(data), 1, torch.device("cpu"))
    scores = validator.scores(EmdNet(small_config))
    windows = data.windows(data.window_starts(1), 1)
    before, after = windows.grids[:, 0].float(), windows.grids[:, 1].float()
    assert scores.do_nothing == pytest.approx(float((before - after).square().mean()))
    assert scores.empty == pytest.approx(float(after.mean()))
    states = torch.cat([data.windows(data.window_starts(3), 3).grids.flatten(0, 1)]).float()
    mean = states.mean(0)
    assert scores.mean == pytest.approx(float((after - mean).square().mean()), rel=1e-4)
    assert validator.scores(EmdNet(small_config)) == scores


def test_learning_rate_rises_and_falls():
    """Warm-up from near 0 to the peak, then down to the final share."""
    config = TrainingConfig(warm_up_share=0.1, final_learning_rate_share=0.05)
    shares = [learning_rate_share(progress / 100, config) for progress in range(101)]
    assert shares[10] == pytest.approx(1.0)
    assert shares[:11] == sorted(shares[:11])
    assert shares[10:] == sorted(shares[10:], reverse=True)
    assert shares[-1] == pytest.approx(0.05)


def test_command_line_trains_and_reports_errors(shard_directory, tmp_path, monkeypatch, capsys):
    """The script trains with its options, and answers bad data with an error and status 1."""
    small = SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1)
    monkeypatch.setitem(ARCHITECTURES, "spatial", lambda: small)
    out = tmp_path / "out"
    options = ["--out", str(out), "--iterations", "2", "--batch-size", "4", "--device", "cpu"]
    options += ["--free-share", "0", "--near-miss-share", "0"]
    assert main(["--data", str(shard_directory), *options]) == 0
    assert read_provenance(out / "emd_net.safetensors")["iterations"] == 2
    assert main(["--data", str(tmp_path / "absent"), *options]) == 1
    assert "found none" in capsys.readouterr().out


def test_paper_recipe_is_that_of_the_paper():
    """Batches of 16 single manipulations, eta 1e-5, no averaging."""
    paper = RECIPES["paper"]
    assert (paper.recipe, paper.batch_size, paper.rollout_steps) == ("manhattan", 16, 1)
    assert paper.learning_rate == 1e-5
    assert paper.augmentation == AugmentationConfig()

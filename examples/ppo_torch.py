"""PPO in plain torch on the vector environment: `python ppo_torch.py 200`. Needs torch and the extra gym."""

import argparse

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import flatdim
from torch import nn

DISCOUNT, GAE_LAMBDA, CLIP, ENTROPY, EPOCHS, MINIBATCHES = 0.97, 0.95, 0.2, 1e-3, 3, 4


class ActorCritic(nn.Module):
    def __init__(self, observations: int, actions: int) -> None:
        super().__init__()
        self.actor = nn.Sequential(nn.Linear(observations, 128), nn.ELU(), nn.Linear(128, actions))
        self.critic = nn.Sequential(nn.Linear(observations, 128), nn.ELU(), nn.Linear(128, 1), nn.Flatten(-2))
        self.log_std = nn.Parameter(torch.zeros(actions))

    def distribution(self, observation: torch.Tensor) -> torch.distributions.Distribution:
        normal = torch.distributions.Normal(self.actor(observation), self.log_std.exp())
        return torch.distributions.Independent(normal, 1)


def update(model: ActorCritic, optimizer: torch.optim.Optimizer, batch: list[torch.Tensor]) -> None:
    """One PPO update from (observation, action, log probability, advantage, return), (steps, ...) each."""
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(batch[0])).chunk(MINIBATCHES):
            observation, action, old_log_prob, advantage, target = (values[rows] for values in batch)
            distribution = model.distribution(observation)
            ratio = (distribution.log_prob(action) - old_log_prob).exp()
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            surrogate = torch.minimum(ratio * advantage, ratio.clamp(1 - CLIP, 1 + CLIP) * advantage)
            value_error = (model.critic(observation) - target).square()
            loss = (value_error - surrogate - ENTROPY * distribution.entropy()).mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(model.parameters(), 1.0)
            optimizer.step()


def train(iterations: int, num_envs: int = 256, num_steps: int = 24) -> None:
    env = gymnasium.make_vec("footfall.gym:footfall/Go1Velocity-v0", num_envs=num_envs, preset="cpu")
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(env)
    model = ActorCritic(flatdim(env.single_observation_space), flatdim(env.single_action_space))
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-3)
    observation = torch.from_numpy(env.reset(seed=0)[0])
    for iteration in range(iterations):
        steps = []
        with torch.no_grad():
            for _ in range(num_steps):
                distribution = model.distribution(observation)
                action = distribution.sample()
                next_observation, reward, terminated, truncated, info = env.step(action.numpy())
                if truncated.any():  # time limit: bootstrap with the value of the final observation
                    final_observation = torch.from_numpy(np.stack(info["final_obs"][truncated]))
                    reward[truncated] += DISCOUNT * model.critic(final_observation).numpy()
                outcome = map(torch.from_numpy, (reward, ~(terminated | truncated)))
                estimates = distribution.log_prob(action), model.critic(observation)
                steps.append((observation, action, *estimates, *outcome))
                observation = torch.from_numpy(next_observation)
            observed, actions, log_probs, values, rewards, alive = map(torch.stack, zip(*steps, strict=True))
            advantages, gae, next_value = torch.zeros_like(rewards), 0.0, model.critic(observation)
            for t in reversed(range(num_steps)):
                gae = rewards[t] - values[t] + alive[t] * DISCOUNT * (next_value + GAE_LAMBDA * gae)
                advantages[t], next_value = gae, values[t]
        batch = (observed, actions, log_probs, advantages, advantages + values)
        update(model, optimizer, [rows.flatten(0, 1) for rows in batch])
        print(f"iteration {iteration}: mean return {np.mean(env.return_queue or [np.nan]):.3f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("iterations", type=int)
    iterations = parser.parse_args().iterations
    if iterations < 1:
        parser.exit(2, f"{parser.prog}: expected at least 1 iteration, found {iterations}\n")
    torch.manual_seed(0)
    train(iterations)

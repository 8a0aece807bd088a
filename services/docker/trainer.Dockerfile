# Image for training on NVIDIA GPUs; the host needs NVIDIA's driver and container toolkit. Build it in a clone:
#   docker build --file services/docker/trainer.Dockerfile --tag footfall-trainer .
#   docker run --rm --gpus all --volume "$PWD/runs:/home/trainer/runs" footfall-trainer train --robot go1 --preset gpu
FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
COPY --from=build /wheels /wheels
# JAX's wheels contain CUDA; libegl1 renders the films of a report.
RUN apt-get update && apt-get install --yes --no-install-recommends libegl1 && rm -r /var/lib/apt/lists/*
RUN wheel=$(ls /wheels/*.whl) && pip install --no-cache-dir "${wheel}[train,report]" "jax[cuda12]" \
    && rm -r /wheels && useradd --create-home trainer
ENV NVIDIA_DRIVER_CAPABILITIES=compute,utility,graphics
USER trainer
WORKDIR /home/trainer
ENTRYPOINT ["footfall"]
CMD ["doctor"]

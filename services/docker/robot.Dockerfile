# Image for a robot's computer, without JAX, torch or a compiler. Build it in a clone of the repository:
#   docker build --file services/docker/robot.Dockerfile --tag footfall-robot .
# With extras: --build-arg EXTRAS=cockpit
FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
ARG EXTRAS=
COPY --from=build /wheels /wheels
RUN wheel=$(ls /wheels/*.whl) && pip install --no-cache-dir "$wheel${EXTRAS:+[$EXTRAS]}" && rm -r /wheels \
    && useradd --create-home robot && install --directory --owner robot /logs
USER robot
WORKDIR /home/robot
ENTRYPOINT ["footfall"]
CMD ["doctor"]

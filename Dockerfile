# auv-fault in a container: the live page, and the diagnosis of logs in the current folder.
#
#     docker build -t auv-fault .
#     docker run --rm --network host auv-fault watch
#     docker run --rm -v "$PWD:/logs" auv-fault diagnose --vehicle vehicle.toml mission.csv
#
# The live page answers its own machine alone, so that the container shares the network of the host.
FROM python:3.11-slim

WORKDIR /opt/auv-fault
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY auv_fault_env auv_fault_env
COPY diagnosers diagnosers
COPY training training

# `--build-arg EXTRA_INDEX=...` names where to find a PyTorch without CUDA, which is smaller
ARG EXTRA_INDEX
RUN pip install --no-cache-dir ${EXTRA_INDEX:+--extra-index-url "$EXTRA_INDEX"} \
    -c constraints.txt '.[live,logs]'

# compiled once, not at every start
ENV NUMBA_CACHE_DIR=/var/cache/auv-fault
RUN python -c "from training.live.session import Session; Session(0).step()" \
    && chmod -R a+rwX /var/cache/auv-fault

WORKDIR /logs
ENTRYPOINT ["auv-fault"]
CMD ["watch"]

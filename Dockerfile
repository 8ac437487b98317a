# The demo on one port: docker build -t walk . && docker run -p 8000:8000 -v walk-runs:/data walk
# Locked and hash-checked by requirements-runtime.lock. docs/deployment.md tells the rest.

# The tag of one version of Debian. A digest would hold its bytes as well: --build-arg BASE_IMAGE=debian@sha256:...
ARG BASE_IMAGE=docker.io/library/debian:12.12-slim

FROM ${BASE_IMAGE} AS build
RUN apt-get update && apt-get install -y --no-install-recommends python3-venv && rm -rf /var/lib/apt/lists/* /var/cache/apt/*
WORKDIR /src

# The tools that make the wheel stay in /tools; what runs goes to /opt/walk, which has no pip.
RUN python3 -m venv /tools && python3 -m venv --without-pip /opt/walk
COPY requirements-runtime.lock requirements-build.lock ./
RUN /tools/bin/pip install --no-cache-dir --require-hashes -r requirements-build.lock
RUN /tools/bin/pip --python /opt/walk/bin/python install --no-cache-dir --require-hashes -r requirements-runtime.lock
COPY pyproject.toml README.md LICENSE ./
COPY walkcore walkcore
COPY app app
COPY static static
RUN /tools/bin/pip wheel --no-deps --no-build-isolation --wheel-dir /wheels . \
    && /tools/bin/pip --python /opt/walk/bin/python install --no-deps --no-index /wheels/*.whl

# Less than half the size: without headers, archives, tests, models of robots that do not walk here, Arrow's clouds,
# rays for meshes, and libraries that a wheel, which holds no links, carries under each of their names.
RUN cd /opt/walk/lib/python3*/site-packages \
    && rm -rf cmeel.prefix/include cmeel.prefix/share/cmake cmeel.prefix/share/doc cmeel.prefix/lib/cmake \
        cmeel.prefix/lib/*.a pyarrow/include pyarrow/tests pyarrow/*arrow_flight* pyarrow/_flight* pyarrow/*arrow_s3* \
        pyarrow/_s3fs* embreex embreex.libs \
    && find matplotlib numpy scipy -type d -name tests -prune -exec rm -rf {} + \
    && for robot in cmeel.prefix/share/example-robot-data/robots/*; do \
        grep -qr "$(basename "$robot")" walkcore/robots || rm -rf "$robot"; done \
    && cd cmeel.prefix/lib && for a in *.so*; do for b in "${a%%.so*}".so*; do \
        if [ "$a" != "$b" ] && [ ! -L "$a" ] && [ ! -L "$b" ] && cmp -s "$a" "$b"; then ln -sf "$b" "$a"; fi; done; done

FROM ${BASE_IMAGE}
# libgomp1 is for Pinocchio.
RUN apt-get update && apt-get install -y --no-install-recommends python3 libgomp1 && rm -rf /var/lib/apt/lists/* /var/cache/apt/* \
    && useradd --system --create-home --uid 990 walk && install -d -o walk -g walk /data
COPY --from=build /opt/walk /opt/walk
ENV PATH=/opt/walk/bin:$PATH HOST=0.0.0.0 PORT=8000 WALK_DATA=/data MPLCONFIGDIR=/tmp
USER walk
WORKDIR /data
VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import os, urllib.request as r; r.urlopen(f'http://127.0.0.1:{os.environ[\"PORT\"]}/api/v1/health', timeout=4)"]
ENTRYPOINT ["walk"]
CMD ["serve"]

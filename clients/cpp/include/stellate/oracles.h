#pragma once

// Oracles of what people have: docs/using/oracles.md.
#include "stellate/oracles/combined.h"
#include "stellate/oracles/equations.h"
#include "stellate/oracles/parametrized.h"
#include "stellate/oracles/points.h"
#include "stellate/oracles/walls.h"

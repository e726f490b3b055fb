#pragma once

// Oracles of what people have, the library stellate::oracles: docs/using/oracles.md.
#include "stellate/oracles/equations.h"
#include "stellate/oracles/parametrized.h"
#include "stellate/oracles/points.h"

#pragma once

// The whole C++ client: write an Oracle, call MeshManifold, read Mesh::report, Mesh::Save. Ready
// oracles are in stellate/oracles.h, and in a library of their own.
#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "stellate/command_oracle.h"
#include "stellate/connection.h"
#include "stellate/doctor.h"
#include "stellate/download.h"
#include "stellate/implicit.h"
#include "stellate/mesh.h"
#include "stellate/monitor.h"
#include "stellate/oracle.h"
#include "stellate/oracles/combined.h"
#include "stellate/oracles/walls.h"
#include "stellate/pointwise.h"
#include "stellate/reconstruct.h"
#include "stellate/serve.h"
#include "stellate/solids.h"
#include "stellate/version.h"

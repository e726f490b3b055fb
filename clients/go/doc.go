// Package stellate meshes compact smooth manifolds of any dimension, with or without boundary, that are known
// through oracles alone.
//
// Arrays are flat, in C order: point i of a batch in R^d is x[i*d : (i+1)*d], and entry (row, column)
// of its basis [d, k] is bases[(i*d+row)*k+column].
package stellate

//go:generate ./generate

package stellate

import (
	"encoding/binary"
	"fmt"
	"math"

	pb "stellate/proto/v1"
)

// shaped is what Array and IndexArray have in common.
type shaped interface {
	GetShape() []uint32
	GetData() []byte
}

// checkShape compares the array with a shape, whose first extent is any where it is below zero. An
// absent array has no rows. It returns the number of numbers.
func checkShape(array shaped, width int, shape ...int) (int, error) {
	given, data := array.GetShape(), array.GetData()
	if len(given) == 0 && len(data) == 0 && shape[0] <= 0 {
		return 0, nil
	}
	fits, count := len(given) == len(shape), uint64(1)
	for i := 0; fits && i < len(shape); i++ {
		fits = shape[i] < 0 || given[i] == uint32(shape[i])
		count *= uint64(given[i])
	}
	if !fits || uint64(len(data)) != count*uint64(width) {
		return 0, fmt.Errorf("an array of shape %v and %d bytes came, not one of shape %v", given, len(data), shape)
	}
	return int(count), nil
}

func numbers(array *pb.Array, shape ...int) ([]float64, error) {
	count, err := checkShape(array, 8, shape...)
	values := make([]float64, count)
	for i := range values {
		values[i] = math.Float64frombits(binary.LittleEndian.Uint64(array.Data[8*i:]))
	}
	return values, err
}

func indices(array *pb.IndexArray, shape ...int) ([]uint32, error) {
	count, err := checkShape(array, 4, shape...)
	values := make([]uint32, count)
	for i := range values {
		values[i] = binary.LittleEndian.Uint32(array.Data[4*i:])
	}
	return values, err
}

func toWire(values []float64, shape ...int) *pb.Array {
	array := &pb.Array{Shape: make([]uint32, len(shape)), Data: make([]byte, 8*len(values))}
	for i, extent := range shape {
		array.Shape[i] = uint32(extent)
	}
	for i, value := range values {
		binary.LittleEndian.PutUint64(array.Data[8*i:], math.Float64bits(value))
	}
	return array
}

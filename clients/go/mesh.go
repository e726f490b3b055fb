package stellate

import (
	"bufio"
	"errors"
	"fmt"
	"io"
	"os"
	"path/filepath"
	"slices"
	"strconv"
	"strings"

	pb "stellate/proto/v1"
)

// Mesh is a simplicial k-complex in R^d, finished or growing.
type Mesh struct {
	Dimension        int       // k
	AmbientDimension int       // d
	Points           []float64 // [n, d]
	Simplices        []uint32  // [m, k+1], zero-based, ascending in each row, rows in lexicographic order
	Walls            []uint64  // [n], as bits the walls that each vertex lies on; nil without a boundary
	Turned           []byte    // see OrientedSimplices; as the protocol has Orientation.turned
	// Places says what became of each point of a reconstruction, "OK" or another Place of mesh.proto; nil of
	// other meshes.
	Places   []string
	Smoothed []float64 // [n, d], the positions that a reconstruction of noisy points was built on, or nil
	Revision uint64    // one for each round that changed the mesh
	Progress *pb.Progress
	Report   *pb.Report // how it ended and what is proved; nil while it grows
}

// VertexCount is n.
func (m *Mesh) VertexCount() int { return len(m.Points) / m.AmbientDimension }

// SimplexCount is m.
func (m *Mesh) SimplexCount() int { return len(m.Simplices) / (m.Dimension + 1) }

// Certified says whether the mesh is finished and proved good.
func (m *Mesh) Certified() bool { return m.Report.GetCertificate().GetCertified() }

// OrientedSimplices are the simplices with the last two vertices of some exchanged so that neighbours
// agree, and normals of hypersurfaces point outwards. The server tells it of meshes that are over. nil if the
// mesh is not orientable, and where that is not known: while it grows, and of a .txt file.
func (m *Mesh) OrientedSimplices() []uint32 {
	if m.Turned == nil {
		return nil
	}
	oriented, width := slices.Clone(m.Simplices), m.Dimension+1
	for s := range m.SimplexCount() {
		if last := (s+1)*width - 1; isSet(m.Turned, s) {
			oriented[last-1], oriented[last] = oriented[last], oriented[last-1]
		}
	}
	return oriented
}

// Boundary are the (k-1)-faces that are in one simplex alone, [m, k], in lexicographic order; each lies on
// the walls that all its vertices have in common.
func (m *Mesh) Boundary() []uint32 {
	k := m.Dimension
	var faces []uint32
	for i := 0; i < len(m.Simplices); i += k + 1 {
		for left := range k + 1 {
			for j, id := range m.Simplices[i : i+k+1] {
				if j != left {
					faces = append(faces, id)
				}
			}
		}
	}
	var once []int32
	order := sortedOrder(faces, k)
	for i := 0; i < len(order); {
		first := i
		for ; i < len(order) && slices.Equal(rowAt(faces, k, order[i]), rowAt(faces, k, order[first])); i++ {
		}
		if i == first+1 {
			once = append(once, order[first])
		}
	}
	return takeRows(faces, k, once)
}

// LoadTxt reads the .txt format back, to the last bit.
func LoadTxt(path string) (*Mesh, error) {
	text, err := os.ReadFile(path)
	if err != nil {
		return nil, err
	}
	var head [4]int
	words := strings.Fields(string(text))
	for i := range head {
		if len(words) > i && err == nil {
			head[i], err = strconv.Atoi(words[i])
		}
	}
	m := &Mesh{Dimension: head[0], AmbientDimension: head[1]}
	end := 4 + head[1]*head[2]
	if err != nil || len(words) != end+(head[0]+1)*head[3] {
		return nil, newError(ErrSave, "FORMAT", "%s does not have the numbers that its first line speaks of", path)
	}
	for _, word := range words[4:end] {
		value, wrong := strconv.ParseFloat(word, 64)
		m.Points, err = append(m.Points, value), errors.Join(err, wrong)
	}
	for _, word := range words[end:] {
		id, wrong := strconv.ParseUint(word, 10, 32)
		m.Simplices, err = append(m.Simplices, uint32(id)), errors.Join(err, wrong)
	}
	return m, err
}

// CheckSave says why a mesh of that kind cannot be saved under the name, or nil.
func CheckSave(path string, k, d int) error {
	switch ending := filepath.Ext(path); {
	case ending == ".txt":
		return nil
	case ending != ".obj":
		return newError(ErrSave, "FORMAT",
			"%s has to end in .txt or .obj; \"stellate download\" writes the other formats", path)
	case k > 2 || d > 3:
		return newError(ErrSave, "FORMAT", ".obj holds curves and surfaces in the plane and in space: take .txt")
	}
	return nil
}

// Save writes .txt (any k and d, exact: "k d nv ns", coordinates, ids from zero) or .obj (curves and
// surfaces, d <= 3, oriented as OrientedSimplices are). The file takes its name when it is whole.
func (m *Mesh) Save(path string) error {
	if err := CheckSave(path, m.Dimension, m.AmbientDimension); err != nil {
		return err
	}
	file, err := os.CreateTemp(filepath.Dir(path), filepath.Base(path)+".*.part")
	if err != nil {
		return err
	}
	defer os.Remove(file.Name())
	out := bufio.NewWriter(file)
	if filepath.Ext(path) == ".txt" {
		fmt.Fprintln(out, m.Dimension, m.AmbientDimension, m.VertexCount(), m.SimplexCount())
		m.writePoints(out, "", "")
		writeRows(out, "", m.Simplices, m.Dimension+1, 0)
	} else {
		m.writeObj(out)
	}
	if err = out.Flush(); err == nil {
		err = file.Chmod(0o644)
	}
	if closing := file.Close(); err == nil {
		err = closing
	}
	if err != nil {
		return err
	}
	return os.Rename(file.Name(), path)
}

func (m *Mesh) writeObj(out io.StringWriter) {
	filled := strings.Repeat(" 0", 3-m.AmbientDimension)
	m.writePoints(out, "v ", filled)
	cells := m.OrientedSimplices()
	if cells == nil {
		cells = m.Simplices
	}
	letter := "f "
	if m.Dimension == 1 {
		letter = "l "
	}
	writeRows(out, letter, cells, m.Dimension+1, 1)
}

// A bufio.Writer keeps its first error, which Flush returns.

func (m *Mesh) writePoints(out io.StringWriter, before, after string) {
	d := m.AmbientDimension
	words := make([]string, d)
	for i := 0; i < len(m.Points); i += d {
		for j, value := range m.Points[i : i+d] {
			words[j] = strconv.FormatFloat(value, 'g', 17, 64)
		}
		_, _ = out.WriteString(before + strings.Join(words, " ") + after + "\n")
	}
}

func writeRows(out io.StringWriter, before string, rows []uint32, width int, first uint64) {
	words := make([]string, width)
	for i := 0; i < len(rows); i += width {
		for j, id := range rows[i : i+width] {
			words[j] = strconv.FormatUint(uint64(id)+first, 10)
		}
		_, _ = out.WriteString(before + strings.Join(words, " ") + "\n")
	}
}

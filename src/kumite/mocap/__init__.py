"""Motion capture files in: BVH and ASF/AMC, single or by the folder, as clips in our conventions."""
